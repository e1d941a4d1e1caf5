"""Event loop of emulated servos: the line, the servos and the arm behind them."""

import select
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.arm.servos import Servos
from s2c2a.emulation import dynamixel_protocol
from s2c2a.emulation.line import Line
from s2c2a.emulation.plant import Plant
from s2c2a.emulation.servo import MotorState, Servo
from s2c2a.emulation.winch import Winch
from s2c2a.emulation.xl330 import XL330
from s2c2a.files import write_atomically
from s2c2a.robots.simulation.transmission import tick_length

SUPPLY = 5.0  # V
_LATEST = 0.2  # s; physics that is later than this loses the time
_PATIENCE = 0.03  # s; physics waits so long for an answer that is nearly due
_NEARLY = 0.0006  # s

_TURN_STREAM = 12
_NOISE_STREAM = 13


@dataclass(frozen=True)
class EmulatorOptions:
    """Options of an emulator.

    Attributes:
        fidelity: of the simulation.
        seed: of slack, positions, noise and faults.
        payload: mass at the tip [kg].
        homed: whether the cables start without slack.
        firmware: of the servos.
        link: symbolic link to the port; None: in a new temporary folder.
        port_file: file for the name of the port.
        duration: time after which the emulator ends [s].
    """

    fidelity: str = "fast"
    seed: int = 0
    payload: float = 0.0
    homed: bool = False
    firmware: int = 52
    link: Path | None = None
    port_file: Path | None = None
    duration: float = float("inf")


def default_servos(arm: ArmSpec) -> Servos:
    """Return the servos of an arm without a table `[servos]`: ids from 1, row by row."""
    cables = arm.cable_count
    rows = range(arm.module_count)
    ids = tuple(tuple(range(1 + row * cables, 1 + (row + 1) * cables)) for row in rows)
    return Servos(ids=ids)


class Emulator:
    """Servos of an arm on a pseudo-terminal, in real time.

    Attributes:
        plant: the arm and its motors.
        winches: servos with their cables, module by module.
        line: the port.
        now: time since the start [s].
    """

    def __init__(self, arm: ArmSpec, options: EmulatorOptions):
        """Power the servos up; `run` opens the port.

        Raises:
            S2C2AError: the arm cannot be driven by servos, or an option is invalid.
        """
        self.options = options
        self.table = arm.servos or default_servos(arm)
        self.plant = Plant(
            arm, options.fidelity, options.seed, options.payload, options.homed
        )
        self._random = np.random.default_rng([options.seed, _NOISE_STREAM])
        self.winches = self._make_winches()
        self.voltage = SUPPLY
        self.now = 0.0
        link = options.link or Path(tempfile.mkdtemp(prefix="s2c2a-servos-")) / "port"
        self.line = Line(link, self.table.baud_rate)
        self._decoder = dynamixel_protocol.Decoder()
        self._stopped = False
        self._late = 0.0

    @property
    def servos(self) -> list[Servo]:
        """The servos, module by module."""
        return [winch.servo for winch in self.winches]

    def stop(self) -> None:
        """Let `run` end soon; for signal handlers and other threads."""
        self._stopped = True

    def run(self, on_ready: Callable[[str], None] = lambda port: None) -> None:
        """Serve the port until `stop` is called or the duration is over.

        Args:
            on_ready: gets the name of the port when it is open.
        """
        self.line.plug()
        try:
            if self.options.port_file is not None:
                write_atomically(f"{self.line.link}\n", self.options.port_file)
            on_ready(str(self.line.link))
            start = time.monotonic()
            while not self._stopped and self.now < self.options.duration:
                self._wait(start)
                self.now = time.monotonic() - start
                self._serve()
        finally:
            self.line.unplug()

    def _wait(self, start: float) -> None:
        """Sleep until bytes arrive or something is due."""
        due = min(self.line.next_time, self._late + self.plant.time + self.plant.chunk)
        timeout = max(0.0, due - (time.monotonic() - start))
        files = [self.line.file] if self.line.is_plugged else []
        select.select(files, [], [], timeout)

    def _serve(self) -> None:
        if self.line.is_plugged:
            self._receive()
            self.line.transmit(self.now)
        self._advance()

    def _receive(self) -> None:
        data = self.line.receive()
        if not data:
            return
        self.line.occupy(len(data), self.now)
        baud_rate = self.line.set_baud_rate()
        for packet in self._decoder.feed(data, self.now):
            listening = [
                servo for servo in self.servos if self._hears(servo, baud_rate)
            ]
            answers = dynamixel_protocol.answer(packet, listening, self.now)
            self.line.queue(answers)

    def _hears(self, servo: Servo, baud_rate: int | None) -> bool:
        return servo.is_present(self.now) and baud_rate in (None, servo.baud_rate)

    def _advance(self) -> None:
        """Advance the physics by at most one chunk, towards the wall clock."""
        late = self.now - self._late - self.plant.time
        if late < self.plant.chunk:
            return
        if late < _PATIENCE and self.line.next_time - self.now < _NEARLY:
            return
        if late > _LATEST:
            self._late += late - self.plant.chunk
        for winch in self.winches:
            winch.set_targets(self.plant)
        self.plant.advance()
        for winch in self.winches:
            state = winch.measure(self.plant, self.voltage, self._random)
            winch.servo.update(state, self.plant.chunk, self.now)

    def _make_winches(self) -> list[Winch]:
        """Power up one servo a cable, each somewhere within its turn."""
        motor = self.plant.arm.motor
        random = np.random.default_rng([self.options.seed, _TURN_STREAM])
        directions = np.ones(len(self.plant.positions), int)
        if self.table.directions is not None:
            directions = np.array(self.table.directions).ravel()
        winches = []
        for cable, id in enumerate(id for row in self.table.ids for id in row):
            ticks = random.uniform(0, motor.ticks_per_turn)
            servo = XL330(id, MotorState(ticks=ticks), self.options.firmware)
            servo.baud_rate = self.table.baud_rate
            if self.table.torque_constant is not None:
                servo.torque_constant = self.table.torque_constant
            winch = Winch(
                servo,
                cable,
                int(directions[cable]),
                0.0,
                tick_length(motor),
                motor.pulley_radius,
            )
            winch.home_ticks = ticks - winch.ticks(self.plant.positions[cable])
            winches.append(winch)
        return winches
