"""Event loop of emulated servos: the line, the servos and the arm behind them."""

import socket
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.arm.servos import servos_of
from s2c2a.errors import S2C2AError
from s2c2a.files.text import write_atomically
from s2c2a.lab.emulation.dynamixel_protocol import DynamixelProtocol
from s2c2a.lab.emulation.fault_texts import Fault
from s2c2a.lab.emulation.faults import GRAMMAR, FaultSchedule, LineFaults
from s2c2a.lab.emulation.feetech_protocol import FeetechProtocol
from s2c2a.lab.emulation.instructions import ServoProtocol
from s2c2a.lab.emulation.line import Line
from s2c2a.lab.emulation.mocap_server import MocapServer
from s2c2a.lab.emulation.motive import Motive, MotiveOptions
from s2c2a.lab.emulation.outputs import PositionRecord, StatusFile, parse_address
from s2c2a.lab.emulation.plant import Plant
from s2c2a.lab.emulation.pose_datagrams import DatagramOptions, PoseDatagrams
from s2c2a.lab.emulation.real_time import RealTimeArm
from s2c2a.lab.emulation.servo import MotorState, Servo
from s2c2a.lab.emulation.winch import Pulley, Winch
from s2c2a.lab.emulation.xl330 import firmware_of

_PATIENCE = 0.03  # s; physics waits so long for an answer that is nearly due
_NEARLY = 0.0006  # s

PROTOCOLS: dict[str, ServoProtocol] = {
    "dynamixel": DynamixelProtocol(),
    "feetech": FeetechProtocol(),
}
Output = StatusFile | PositionRecord

_TURN_STREAM = 12
_NOISE_STREAM = 13
_LINE_STREAM = 14


@dataclass(frozen=True)
class EmulatorOptions:
    """Options of an emulator.

    Attributes:
        fidelity: of the simulation.
        seed: of slack, positions, noise and faults.
        payload: mass at the tip [kg].
        homed: whether the arm is in use: its cables start without slack, and its servos
            store the settings of `motors home`.
        firmware: of Dynamixel servos.
        faults: as texts (`faults.GRAMMAR`).
        link: symbolic link to the port; None: in a new temporary folder.
        port_file: file for the name of the port.
        status_file: JSON file with the state of the servos.
        poses_to: HOST:PORT that gets the true poses; none if empty.
        pose_rate: poses and recorded positions a second [Hz].
        record: CSV file with the true positions of the module ends.
        mocap: an emulated Motive that tracks the same arm; None for none.
        duration: time after which the emulator ends [s].
    """

    fidelity: str = "fast"
    seed: int = 0
    payload: float = 0.0
    homed: bool = False
    firmware: int = 52
    faults: tuple[str, ...] = ()
    link: Path | None = None
    port_file: Path | None = None
    status_file: Path | None = None
    poses_to: str = ""
    pose_rate: float = 100.0
    record: Path | None = None
    mocap: MotiveOptions | None = None
    duration: float = float("inf")

    def __post_init__(self):
        if not 1 <= self.pose_rate <= 1000:
            raise S2C2AError(
                f"pose_rate {self.pose_rate} Hz is not allowed; give 1 to 1000 Hz"
            )
        if not 1 <= self.firmware <= 255:
            raise S2C2AError(
                f"firmware {self.firmware} is not allowed; give a version from 1 to 255"
            )
        if self.poses_to:
            parse_address(self.poses_to)
        if not self.duration > 0:
            raise S2C2AError(
                f"duration {self.duration} s is not allowed; give more than 0 s"
            )


class Emulator(RealTimeArm):
    """Servos of an arm on a pseudo-terminal, in real time.

    Attributes:
        options: of the emulator.
        winches: servos with their cables, module by module.
        lines: the ports, one for each that the arm file names.
        disturbances: of the line.
        voltage: of the supply [V].
        packet_count: instructions that arrived.
        largest_command: largest displacement that a powered motor was sent to [m].
        largest_current: largest current of a motor [A].
    """

    def __init__(self, arm: ArmSpec, options: EmulatorOptions):
        """Power the servos up; `run` opens the port.

        Raises:
            S2C2AError: the arm cannot be driven by servos, or an option is invalid.
        """
        self.options = options
        self.table = servos_of(arm)
        for part, _ in self.table.parts():
            own = part.own_model
            if own is not None and own.registers.model_dump(exclude_none=True):
                raise S2C2AError(
                    "emulated servos have the addresses of the X series; leave out "
                    "servos.own_model.registers in the arm file of the emulator"
                )
            self._protocol = PROTOCOLS[part.protocol]
            baud_rates = self._protocol.make_servo.baud_rates
            if part.baud_rate not in baud_rates:
                raise S2C2AError(
                    f"servos.baud_rate {part.baud_rate} is not a speed of "
                    f"{part.protocol} servos; choose one of "
                    f"{', '.join(map(str, baud_rates))}"
                )
        self._schedule = FaultSchedule(self._parse_faults())
        plant = Plant(
            arm, options.fidelity, options.seed, options.payload, options.homed
        )
        super().__init__(plant, options.duration)
        self.disturbances = LineFaults(self._random_stream(_LINE_STREAM))
        self._noise = self._random_stream(_NOISE_STREAM)
        self._parts = self.table.parts()
        self.winches = self._make_winches()
        self.voltage = self._protocol.supply
        self._folder: Path | None = None
        self._line_numbers = {
            id: self.ports.index(part.port) for part, ids in self._parts for id in ids
        }
        self.lines = self._make_lines()
        self._decoders = [self._protocol.decoder() for _ in self.lines]
        self._plug_times = [float("inf")] * len(self.lines)
        self._outputs: list[Output] = []
        self._servers: list[MocapServer] = []
        self.packet_count = 0
        self.largest_command = 0.0
        self.largest_current = 0.0

    @property
    def servos(self) -> list[Servo]:
        """The servos, module by module."""
        return [winch.servo for winch in self.winches]

    @property
    def ports(self) -> list[str]:
        """Ports of the arm file, in the order of `lines`."""
        return list(dict.fromkeys(part.port for part, _ in self._parts))

    def unplug(self, seconds: float, id: int | None = None) -> None:
        """Take ports away for a time [s]; the servos keep their power.

        Args:
            seconds: the time.
            id: of a servo on the port; None: all ports.
        """
        for number, line in enumerate(self.lines):
            if id is None or number == self._line_numbers[id]:
                line.unplug()
                self._plug_times[number] = self.now + seconds

    def run(self, on_ready: Callable[[str], None] = lambda port: None) -> None:
        """Serve the port until `stop` is called or the duration is over.

        Args:
            on_ready: gets the name of the port when it is open.

        Raises:
            S2C2AError: a file cannot be written.
            SimulationError: the simulation diverged.
        """
        for line in self.lines:
            line.plug()
        options = self.options
        names = list(self.plant.poses())
        if options.status_file is not None:
            self._outputs.append(StatusFile(options.status_file))
        if options.record is not None:
            modules = self.plant.arm.module_count
            record = PositionRecord(options.record, modules, options.pose_rate)
            self._outputs.append(record)
        if options.poses_to:
            receiver = parse_address(options.poses_to)
            stream = DatagramOptions(rate=options.pose_rate, receiver=receiver)
            self._servers.append(PoseDatagrams(names, stream))
        if options.mocap is not None:
            # physics reads the motors' positions earlier than their encoders do, so
            # that the arm leads; frames wait for the encoders
            latency = options.mocap.latency + self.plant.lead
            motive = Motive(names, replace(options.mocap, latency=latency))
            motive.open()
            self._servers.append(motive)
        try:
            links = [str(line.link) for line in self.lines]
            if self.options.port_file is not None:
                write_atomically("\n".join([*links, ""]), self.options.port_file)
            on_ready(", ".join(links))
            self._loop()
        finally:
            for line in self.lines:
                line.unplug()
            for opened in (*self._outputs, *self._servers):
                opened.close()
            if self._folder is not None:
                self._folder.rmdir()

    @property
    def _files(self) -> list[int | socket.socket]:
        return [line.file for line in self.lines if line.is_plugged]

    def _next_time(self) -> float:
        # a frame must not wait for the physics
        servers = [server.next_time for server in self._servers]
        return min([line.next_time for line in self.lines] + servers)

    def _serve_all(self) -> None:
        self.serve()
        for server in self._servers:
            server.serve(self.now, self.plant.poses)
        for output in self._outputs:
            output.write(self, self.now)

    def serve(self) -> None:
        """Do what is due at `now`: faults, bytes in, bytes out, a chunk of physics."""
        self._schedule.apply_until(self)
        for number, line in enumerate(self.lines):
            if self.now >= self._plug_times[number]:
                self._plug_times[number] = float("inf")
                line.plug()
            if line.is_plugged:
                self._receive(number, line)
                line.transmit(self.now)
        self._advance()

    def _receive(self, number: int, line: Line) -> None:
        data = line.receive()
        if not data:
            return
        line.occupy(len(data), self.now)
        for packet in self._decoders[number].feed(data, self.now):
            self.packet_count += 1
            listening = self._listening(number, line)
            answers = self._protocol.answer(packet, listening, self.now)
            line.queue(self.disturbances.disturb(answers))

    def _listening(self, number: int, line: Line) -> list[Servo]:
        """Return the servos that hear a line: those on it, at its baud rate."""
        baud_rate = line.user_baud_rate()
        return [
            winch.servo
            for winch in self.winches
            if self._line_numbers[winch.original_id] == number
            and winch.servo.is_present(self.now)
            and baud_rate in (None, winch.servo.baud_rate)
        ]

    def _is_busy(self, behind: float) -> bool:
        next_time = min(line.next_time for line in self.lines)
        is_answering = next_time - self.now < _NEARLY
        return behind < _PATIENCE and is_answering

    def advance_chunk(self) -> None:
        """Advance motors, arm and servos by one chunk of physics."""
        for winch in self.winches:
            winch.set_targets(self.plant)
        self.plant.advance()
        for winch in self.winches:
            state = winch.measure(self.plant, self.voltage, self._noise)
            winch.servo.update(state, self.plant.chunk, self.now)
        targets = self.plant.targets
        goals = np.abs(targets.goal)
        largest = float(np.max(goals, where=targets.torque, initial=0.0))
        self.largest_command = max(self.largest_command, largest)
        current = max(abs(servo.state.current) for servo in self.servos)
        self.largest_current = max(self.largest_current, current)

    def _parse_faults(self) -> list[Fault]:
        faults = GRAMMAR.parse(self.options.faults, self._ids)
        stuffed = any(fault.kind == "stuffed" for fault in faults)
        if stuffed and not self._protocol.stuffs:
            raise S2C2AError(
                f"the fault 'stuffed' needs a protocol with byte stuffing, and the arm "
                f'has servos.protocol = "{self.table.protocol}"; leave it out'
            )
        return faults

    @property
    def _ids(self) -> list[int]:
        return [id for row in self.table.ids for id in row]

    def _make_lines(self) -> list[Line]:
        """One line a port; the second one's link ends in -2."""
        link = self.options.link
        if link is None:
            self._folder = Path(tempfile.mkdtemp(prefix="s2c2a-servos-"))
            link = self._folder / "port"
        rates = {part.port: part.baud_rate for part, _ in self._parts}
        first, *others = rates.values()
        lines = [Line(link, first)]
        for number, rate in enumerate(others, 2):
            lines.append(Line(link.with_name(f"{link.name}-{number}"), rate))
        return lines

    def _random_stream(self, stream: int) -> np.random.Generator:
        return np.random.default_rng([self.options.seed, stream])

    def _make_winches(self) -> list[Winch]:
        """Power up one servo a cable, each somewhere within its turn."""
        ids = self._ids
        random = self._random_stream(_TURN_STREAM)
        directions = [1] * len(ids)
        if self.table.directions is not None:
            directions = [one for row in self.table.directions for one in row]
        motor = self.plant.arm.motor
        ticks = random.uniform(0, motor.ticks_per_turn, len(ids))
        pulley = Pulley(motor.pulley_radius, self.table.layer_growth)
        winches = []
        for cable, id in enumerate(ids):
            table = self.table.of(id)
            firmware = firmware_of(table.model_number, self.options.firmware)
            state = MotorState(ticks=float(ticks[cable]))
            servo = self._protocol.make_servo(id, state, firmware)
            servo.ticks_per_turn = motor.ticks_per_turn
            servo.baud_rate = table.baud_rate
            servo["model_number"] = table.model_number
            if self.options.homed:
                servo.set_up(table.limits.current)
            if table.torque_constant is not None:
                servo.torque_constant = table.torque_constant
            winch = Winch(servo, id, cable, directions[cable], pulley)
            start = float(self.plant.positions[cable])
            winch.home_ticks = state.ticks - winch.ticks(start)
            winches.append(winch)
        return winches
