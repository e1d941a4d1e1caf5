"""Servo bus of DYNAMIXEL X-series servos."""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

from s2c2a.lab.hardware.bus import (
    UNKNOWN,
    BusError,
    HardwareError,
    ServoInfo,
    ServoRefusalError,
    ServoState,
    StoredChange,
)
from s2c2a.lab.hardware.dynamixel import tables
from s2c2a.lab.hardware.dynamixel.packets import (
    FAST_SYNC_READ,
    REBOOT,
    DynamixelPackets,
    unstuffed,
)
from s2c2a.lab.hardware.dynamixel.tables import REGISTERS, DynamixelModel
from s2c2a.lab.hardware.packets import (
    BROADCAST,
    PING,
    SYNC_READ,
    WRITE,
    Answer,
    Register,
)
from s2c2a.lab.hardware.serial_bus import (
    ALIAS,
    CYCLE_MARGIN,
    EXCHANGE_MARGIN,
    SerialBus,
    stored_changes,
)
from s2c2a.lab.hardware.serial_line import SerialLine

CYCLE_QUIET_TIME = 0.001
"""Time without a byte, after which no late answer is on its way, in a cycle [s]."""
SCAN_TIME = 0.003  # s for the answer of each possible id
SCANS = 2  # for all servos of a line: noise spoils single answers
ALERT = 0x80
ANSWER_ALL = 2  # status return level
PING_SIZE = 3  # bytes: model number, firmware
REFUSALS = {
    1: "it failed to process the packet",
    2: "it does not know the instruction",
    3: "the checksum was wrong",
    4: "the value is out of range",
    5: "the data have the wrong length",
    6: "the value is beyond a limit",
    7: "the register is read-only now (torque on, or watchdog tripped)",
}
STATE_LAYOUT = (
    "position",
    "velocity",
    "current",
    "voltage",
    "temperature",
    "hardware_error",
    "watchdog",
    "status_return_level",
)
"""Registers that indirect addresses join to one block.

The last one is known: after a restart of the servo the block holds other values, and
the last one is wrong.
"""
STATE_SIZE = sum(REGISTERS[name].size for name in STATE_LAYOUT)


class DynamixelBus(SerialBus):
    """DYNAMIXEL servos of one model on a serial port, with protocol 2.0."""

    brand = "DYNAMIXEL"
    packets = DynamixelPackets()
    registers = REGISTERS
    models: Mapping[str, DynamixelModel] = tables.MODELS
    baud_rates = tables.BAUD_RATES

    def __init__(
        self,
        port: str,
        baud_rate: int = 1_000_000,
        model: str = "xl330-m288",
        fast_read: bool = False,
        watchdog: float = 0.4,
        max_current: float | None = None,
        own_model: DynamixelModel | None = None,
        line: SerialLine | None = None,
    ):
        """Open the port; no servo is asked yet.

        Args:
            port: serial port.
            baud_rate: speed of the bus [bit/s].
            model: a name in `tables.MODELS`.
            fast_read: whether all servos answer a read in one joint packet. It is
                faster, but one lost byte loses the answers of all.
            watchdog: time without an instruction after which a servo with torque stops
                by itself [s].
            max_current: largest current of any motion [A]; by default the model's.
            own_model: a model that is not in the tables, with this name.
            line: see `SerialBus`.

        Raises:
            BusError: unknown model or speed, or the port cannot be opened.
        """
        if own_model is not None:
            self.models = {**tables.MODELS, own_model.name: own_model}
        super().__init__(port, baud_rate, model, max_current, line)
        self.registers = self.model.registers
        self.limit_register = self.model.limit_register
        self.has_current = self.model.has_current
        self._fast_read = fast_read
        self._watchdog = watchdog
        self._indirect_data: dict[int, int] = {}
        self._misses: dict[int, int] = {}
        self._goals: dict[int, int] = {}

    def scan(self, ids: Iterable[int] = ()) -> list[ServoInfo]:
        """Return the servos that answer; see `ServoBus`."""
        wanted = set(ids)
        self._line.write(self.packets.encode(BROADCAST, PING))
        reader = self.packets.reader()
        found = list(self._receive(reader, BROADCAST * SCAN_TIME, wanted))
        infos = []
        for packet in sorted(found, key=lambda packet: packet.id):
            if wanted and packet.id not in wanted:
                continue
            info = self._info_of(packet)
            # two servos with one id are in the list, too
            with suppress(BusError):
                secondary = self.read(info.id, ALIAS)
                if secondary <= tables.MAX_ID:
                    info = replace(info, secondary_id=secondary)
            infos.append(info)
        return infos

    def assign(self, id: int, new_id: int, baud_rate: int) -> None:
        """Store another id and baud rate; see `ServoBus`."""
        code = self._baud_code(baud_rate)
        if new_id != id:
            if self.scan([new_id]):
                raise BusError(
                    f"servo {new_id} is on the bus already; connect one servo at a "
                    "time, or choose another id"
                )
            self._change_identity(id, "id", new_id)
            self.info(new_id)
        self._change_identity(new_id, "baud_rate", code)

    def _prepare_one(
        self,
        info: ServoInfo,
        changes: Sequence[StoredChange],
        current: float,
        speed: float,
    ) -> None:
        id = info.id
        self._goals.pop(id, None)
        # only now: no servo has torque without a watchdog
        self.arm_watchdog([id], 0.0)
        for change in changes:
            self.write(id, change.name, change.new)
        stored_limit = self.read(id, self.model.stored_limit_register)
        self._note_stored_limit(id, stored_limit)
        self.write(id, "status_return_level", ANSWER_ALL)
        self.write(id, "profile_acceleration", 0)
        self.write(id, "profile_velocity", max(round(speed / tables.VELOCITY_UNIT), 1))
        self.set_current([id], current)
        self._join_state(info)

    def set_torque(self, ids: Iterable[int], on: bool) -> None:
        """Switch the torque, of all servos at once; see `ServoBus`."""
        ids = tuple(ids)
        if on:
            # write the last goals again, with a confirmation
            for id in ids:
                if id in self._goals:
                    self.write(id, "goal_position", self._goals[id])
            self.arm_watchdog(ids, self._watchdog)
            self._checked_states(ids)
        self._sync_write("torque", dict.fromkeys(ids, int(on)))
        self._write_values("torque", dict.fromkeys(ids, int(on)))  # with a confirmation

    def arm_watchdog(self, ids: Iterable[int], seconds: float) -> None:
        """Let servos stop without commands; see `ServoBus`."""
        units = 0
        if seconds > 0:
            units = min(
                max(round(seconds / tables.WATCHDOG_UNIT), 1), tables.MAX_WATCHDOG
            )
        self._write_values("watchdog", dict.fromkeys(ids, units))

    def send_goals(self, goals: Mapping[int, int]) -> None:
        """Send goals in one packet, also to a silent servo; see `ServoBus`.

        One that restarts has no torque, and its goal does not move it.
        """
        if max(map(abs, goals.values()), default=0) > tables.MAX_POSITION:
            raise BusError(
                f"goals {dict(goals)} [ticks] exceed +-{tables.MAX_POSITION}, and none "
                "was sent; home the arm again (`s2c2a motors home --overwrite`)"
            )
        self._goals |= goals
        sent = {id: goal for id, goal in goals.items() if id not in self.restarted}
        self._sync_write("goal_position", sent)

    def _read_states(self, ids: Sequence[int]) -> dict[int, ServoState | None]:
        """Read the states of servos.

        Every servo waits for the answer of the one before, so an absent servo silences
        those behind it. From then on it is asked last, and without a joint answer,
        which would lack all of them.
        """
        order = sorted(ids, key=lambda id: self._misses.get(id, 0))
        found: dict[int, ServoState | None] = {}
        for address, group in self._groups(order):
            blocks = self._read_group(address, group)
            for id in blocks:
                self._misses[id] = 0
            missing = [id for id in group if id not in blocks]
            if missing:
                # those behind it may be silent because of it
                self._misses[missing[0]] = self._misses.get(missing[0], 0) + 1
            found |= {id: self._state(block) for id, block in blocks.items()}
        return found

    def reboot(self, id: int) -> None:
        """Restart a servo; see `ServoBus`."""
        self._ask(id, self.packets.encode(id, REBOOT), 0, "reboot")

    def info(self, id: int) -> ServoInfo:
        """Return the identity of one servo.

        Raises:
            BusError: the servo does not answer.
        """
        return self._info_of(self._ask(id, *self._ping(id), "ping"))

    def _ping(self, id: int) -> tuple[bytes, int]:
        """A ping, and the size of its answer."""
        return self.packets.encode(id, PING), PING_SIZE

    def _probes(self, id: int) -> Sequence[tuple[bytes, int]]:
        measurements = self.registers["measurements"]
        read = self.packets.read(id, measurements)
        return (self._ping(id), (read, measurements.size))

    def _info_of(self, packet: Answer) -> ServoInfo:
        number = int.from_bytes(packet.data[:2], "little")
        names = [model.name for model in self.models.values() if model.number == number]
        firmware = packet.data[2] if len(packet.data) > 2 else 0
        return ServoInfo(packet.id, number, (*names, UNKNOWN)[0], firmware)

    def _change_identity(self, id: int, name: str, value: int) -> None:
        """Write a register that changes the id or speed of the answer.

        Which of the old and the new one the answer has is not specified.

        Raises:
            ServoRefusalError: the servo refuses the value.
        """
        self._line.write(self.packets.write(id, self.registers[name], value))
        for answer in self._receive(self.packets.reader(), EXCHANGE_MARGIN, ()):
            self._check_refusal(answer, f"writing {name} = {value}")

    def _stored_changes(self, id: int) -> list[StoredChange]:
        required = {
            "drive_mode": 0,
            "operating_mode": self.model.operating_mode,
            "homing_offset": 0,
            "startup_configuration": 0,
            ALIAS: tables.NO_SECONDARY_ID,
        }
        limit_name = self.model.stored_limit_register
        names = (*required, "return_delay", limit_name)
        stored = {name: self.read(id, name) for name in names}
        if stored[ALIAS] > tables.MAX_ID:
            required[ALIAS] = stored[ALIAS]
        allowed = self._current_units(self._max_current)
        wanted = {"return_delay": 0, limit_name: min(stored[limit_name], allowed)}
        return stored_changes(stored, required, wanted)

    def _changes_of_others(
        self, ids: Collection[int]
    ) -> dict[int, Sequence[StoredChange]]:
        """A servo obeys its secondary id, too, and does not answer it."""
        found = [info for _ in range(SCANS) for info in self.scan()]
        aliases = {info.id: info.secondary_id for info in found if info.id not in ids}
        return {
            id: [StoredChange(ALIAS, alias, tables.NO_SECONDARY_ID)]
            for id, alias in aliases.items()
            if alias is not None and alias in ids
        }

    def _join_state(self, info: ServoInfo) -> None:
        """Let indirect addresses join the registers of `STATE_LAYOUT` to one block."""
        id = info.id
        self._indirect_data[id] = self.model.indirect_data_of(info.firmware)
        addresses: list[int] = []
        for name in STATE_LAYOUT:
            register = self.registers[name]
            addresses += range(register.address, register.address + register.size)
        assert len(addresses) <= tables.INDIRECT_COUNT
        start = self.registers["indirect_address"].address
        data = b"".join(part.to_bytes(2, "little") for part in (start, *addresses))
        packet = self.packets.encode(id, WRITE, data)
        self._ask(id, packet, 0, "writing indirect addresses")

    def _groups(self, ids: Iterable[int]) -> list[tuple[int, list[int]]]:
        """Servos by the address of their joined state."""
        groups: dict[int, list[int]] = {}
        for id in ids:
            if id not in self._indirect_data:
                raise BusError(
                    f"servo {id} was not prepared; call prepare() before read_states()"
                )
            groups.setdefault(self._indirect_data[id], []).append(id)
        return list(groups.items())

    def _read_group(self, address: int, ids: list[int]) -> dict[int, bytes]:
        """Joined blocks of servos."""
        misses = any(self._misses.get(id) for id in ids)
        is_joint = self._fast_read and not misses
        instruction = FAST_SYNC_READ if is_joint else SYNC_READ
        parameters = self.packets.span(Register(address, STATE_SIZE)) + bytes(ids)
        packet = self.packets.encode(BROADCAST, instruction, parameters)
        expected = len(ids) * (self.packets.overhead + STATE_SIZE)
        longest = expected if is_joint else 2 * STATE_SIZE
        reader = self.packets.reader(max_length=longest)
        found: dict[int, bytes] = {}
        awaited = {BROADCAST} if is_joint else set(ids)
        answers = self._exchange(
            packet, reader, STATE_SIZE, CYCLE_MARGIN, awaited, len(ids)
        )
        for answer in answers:
            for id, data in _blocks(answer, len(ids)):
                if id in ids and len(data) == STATE_SIZE:
                    found[id] = data
        if len(found) < len(ids):
            self._line.drain(CYCLE_QUIET_TIME)
        return found

    def _state(self, data: bytes) -> ServoState | None:
        """The state in a joined block; None if the servo has restarted."""
        values = {}
        start = 0
        for name in STATE_LAYOUT:
            register = self.registers[name]
            values[name] = register.decode(data[start : start + register.size])
            start += register.size
        if values["status_return_level"] != ANSWER_ALL:
            return None
        return ServoState(
            position=values["position"],
            velocity=values["velocity"] * tables.VELOCITY_UNIT,
            current=values["current"] * self.model.current_unit
            if self.has_current
            else math.nan,
            voltage=values["voltage"] * tables.VOLTAGE_UNIT,
            temperature=float(values["temperature"]),
            errors=frozenset(
                HardwareError[name]
                for bit, name in tables.HARDWARE_ERROR_BITS.items()
                if values["hardware_error"] & (1 << bit)
            ),
            watchdog_tripped=values["watchdog"] == tables.WATCHDOG_TRIPPED,
        )

    def _check_refusal(self, answer: Answer, purpose: str) -> None:
        number = answer.error & ~ALERT
        if number:
            reason = REFUSALS.get(number, f"error {number}")
            raise ServoRefusalError(f"servo {answer.id} refuses {purpose}: {reason}")


def _blocks(packet: Answer, count: int) -> Iterator[tuple[int, bytes]]:
    """Yield id and data of every servo in a status packet.

    A joint answer holds (error, id, data, checksum) of one servo after the other; the
    last checksum is that of the packet.
    """
    if packet.id != BROADCAST:
        yield packet.id, packet.data
        return
    size = STATE_SIZE + 4
    joint = bytes([packet.error]) + packet.data + bytes(2)
    if len(joint) != count * size:
        joint = unstuffed(joint)
    if len(joint) != count * size:
        return
    for start in range(0, len(joint), size):
        block = joint[start : start + size]
        yield block[1], block[2 : 2 + STATE_SIZE]
