"""Servo bus of DYNAMIXEL X-series servos."""

import time
from collections.abc import Collection, Iterable, Iterator, Mapping

from s2c2a.lab.hardware.bus import (
    BusError,
    HardwareError,
    Hearing,
    Mode,
    PortLostError,
    ServoBus,
    ServoInfo,
    ServoRefusalError,
    ServoState,
    StoredChange,
)
from s2c2a.lab.hardware.dynamixel.packets import (
    BROADCAST,
    Instruction,
    StatusPacket,
    StatusReader,
    encode,
    unstuffed,
)
from s2c2a.lab.hardware.dynamixel.tables import (
    BAUD_RATES,
    CURRENT_LIMITED_POSITION,
    EXTENDED_POSITION,
    HARDWARE_ERROR_BITS,
    INDIRECT_COUNT,
    MAX_POSITION,
    MAX_WATCHDOG,
    MODELS,
    REGISTERS,
    VELOCITY_UNIT,
    VOLTAGE_UNIT,
    WATCHDOG_TRIPPED,
    WATCHDOG_UNIT,
    Register,
)
from s2c2a.lab.hardware.presence import DAMAGED, hear
from s2c2a.lab.hardware.serial_line import SerialLine

ATTEMPTS = 3
CYCLE_MARGIN = 0.02
"""Wait beyond wire time and latency of the adapter, in a cycle [s]; many adapters keep
bytes for up to 16 ms and do not say so."""
EXCHANGE_MARGIN = 0.2  # s; the same, outside of a cycle
QUIET_TIME = 0.02  # s without a byte, after which no late answer is on its way
CYCLE_QUIET_TIME = 0.001  # s; the same, in a cycle
LISTEN_MARGIN = 0.05  # s; the same, to find out whether a servo is there
MEASURED_ADDRESS = 120
MEASURED_SIZE = 27
"""Block of measurements, from the time to the temperature. No two servos have the same
ones, so that the answers of two with one id damage each other."""
SCAN_TIME = 0.003  # s for the answer of each possible id
ALERT = 0x80
ANSWER_ALL = 2  # status return level
PING_SIZE = 3  # bytes: model number, firmware
STATUS_OVERHEAD = 11  # bytes of a status packet without data
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


class DynamixelBus(ServoBus):
    """DYNAMIXEL servos of one model on a serial port, with protocol 2.0.

    Attributes:
        model: facts of the servos' model.
        restarted: see `ServoBus`.
    """

    def __init__(
        self,
        port: str,
        baud_rate: int = 1_000_000,
        model: str = "xl330-m288",
        fast_read: bool = False,
        watchdog: float = 0.4,
        max_current: float | None = None,
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

        Raises:
            BusError: unknown model, or the port cannot be opened.
        """
        if model not in MODELS:
            raise BusError(
                f"no DYNAMIXEL model '{model}' is known; choose one of "
                f"{', '.join(MODELS)}, or add it to s2c2a.lab.hardware.dynamixel.tables"
            )
        self.model = MODELS[model]
        self.ticks_per_turn = 4096
        self.torque_constant = self.model.torque_constant
        self.baud_rates = BAUD_RATES
        self._fast_read = fast_read
        self._watchdog = watchdog
        model_current = self.model.max_current
        self._max_current = min(max_current or model_current, model_current)
        self._current_limits: dict[int, int] = {}
        self._line = SerialLine(port, baud_rate)
        self._indirect_data: dict[int, int] = {}
        self._misses: dict[int, int] = {}
        self._goals: dict[int, int] = {}
        self.restarted: set[int] = set()

    def scan(self, ids: Iterable[int] = ()) -> list[ServoInfo]:
        """Return the servos that answer; see `ServoBus`."""
        wanted = set(ids)
        self._line.write(encode(BROADCAST, Instruction.PING))
        reader = StatusReader()
        found = list(self._receive(reader, BROADCAST * SCAN_TIME, wanted))
        return [
            self._info_of(packet)
            for packet in sorted(found, key=lambda packet: packet.id)
            if not wanted or packet.id in wanted
        ]

    def set_baud_rate(self, baud_rate: int) -> None:
        """Change the speed of the port; see `ServoBus`."""
        self._line.baud_rate = baud_rate

    def assign(self, id: int, new_id: int, baud_rate: int) -> None:
        """Store another id and baud rate; see `ServoBus`."""
        if baud_rate not in BAUD_RATES:
            raise BusError(
                f"DYNAMIXEL servos have no baud rate {baud_rate}; "
                f"choose one of {', '.join(map(str, BAUD_RATES))}"
            )
        if new_id != id:
            if self.scan([new_id]):
                raise BusError(
                    f"servo {new_id} is on the bus already; connect one servo at a "
                    "time, or choose another id"
                )
            self._change_identity(id, "id", new_id)
            self.info(new_id)
        self._change_identity(new_id, "baud_rate", BAUD_RATES.index(baud_rate))

    def prepare(
        self, ids: Iterable[int], mode: Mode, current: float, speed: float
    ) -> None:
        """Set mode and limits with the torque off; see `ServoBus`."""
        ids = tuple(ids)
        infos = [self.info(id) for id in ids]
        for info in infos:
            self.check_model(info, self.model.name, self.model.number)
        changes = {id: self._stored_changes(id, mode) for id in ids}
        accepted = self.confirm_stored(changes)
        self.set_torque(ids, on=False)
        for info in infos:
            id = info.id
            self.restarted.discard(id)
            self._goals.pop(id, None)
            # only now: no servo has torque without a watchdog
            self.arm_watchdog([id], 0.0)
            for change in accepted.get(id, ()):
                self.write(id, change.name, change.new)
            self._note_current_limit(id)
            self.write(id, "status_return_level", ANSWER_ALL)
            self.write(id, "profile_acceleration", 0)
            self.write(id, "profile_velocity", max(round(speed / VELOCITY_UNIT), 1))
            if mode is Mode.CURRENT_LIMITED_POSITION:
                self.set_current([id], current)
            self._join_state(info)

    def set_torque(self, ids: Iterable[int], on: bool) -> None:
        """Switch the torque, of all servos at once; see `ServoBus`."""
        ids = tuple(ids)
        if on:
            self._repeat_goals(ids)
            self.arm_watchdog(ids, self._watchdog)
        self._sync_write("torque", dict.fromkeys(ids, int(on)))
        self._write_each(ids, "torque", int(on))  # with a confirmation

    def set_current(self, ids: Iterable[int], current: float) -> None:
        """Set the largest current; see `ServoBus`."""
        units = round(min(current, self._max_current) / self.model.current_unit)
        limits = {id: self._current_limits.get(id, units) for id in ids}
        values = {id: max(min(units, limit), 1) for id, limit in limits.items()}
        self._write_values("goal_current", values)

    def arm_watchdog(self, ids: Iterable[int], seconds: float) -> None:
        """Let servos stop without commands; see `ServoBus`."""
        units = 0
        if seconds > 0:
            units = min(max(round(seconds / WATCHDOG_UNIT), 1), MAX_WATCHDOG)
        self._write_each(ids, "watchdog", units)

    def send_goals(self, goals: Mapping[int, int]) -> None:
        """Send goal positions; see `ServoBus`."""
        limited = {
            id: min(max(ticks, -MAX_POSITION), MAX_POSITION)
            for id, ticks in goals.items()
        }
        self._goals |= limited
        self._sync_write("goal_position", limited)

    def read_states(self, ids: Iterable[int]) -> dict[int, ServoState]:
        """Read the states of servos; see `ServoBus`.

        Every servo waits for the answer of the one before, so an absent servo silences
        those behind it. From then on it is asked last, and without a joint answer,
        which would lack all of them.
        """
        order = sorted(ids, key=lambda id: self._misses.get(id, 0))
        found: dict[int, ServoState] = {}
        for address, group in self._groups(order):
            blocks = self._read_group(address, group)
            self._count_misses(group, blocks)
            states = {id: self._state(id, block) for id, block in blocks.items()}
            found |= {id: state for id, state in states.items() if state is not None}
        return found

    def listen(self, id: int) -> Hearing:
        """Ask one servo for its identity and its measurements; see `ServoBus`."""
        return hear(lambda: self._listen_once(id), ATTEMPTS)

    def reboot(self, id: int) -> None:
        """Restart a servo; see `ServoBus`."""
        self._exchange(id, Instruction.REBOOT)

    def close(self) -> None:
        """Close the port; see `ServoBus`."""
        self._line.close()

    def read(self, id: int, name: str) -> int:
        """Return a register of a servo, by its name in `tables.REGISTERS`.

        Raises:
            BusError: the servo does not answer.
        """
        return self._read(id, REGISTERS[name])

    def write(self, id: int, name: str, value: int) -> None:
        """Write a register of a servo and wait for the confirmation.

        Raises:
            ServoRefusalError: the servo refuses the value.
            BusError: the servo does not answer.
        """
        register = REGISTERS[name]
        data = register.address.to_bytes(2, "little") + register.encode(value)
        self._exchange(id, Instruction.WRITE, data, f"writing {name} = {value}")

    def info(self, id: int) -> ServoInfo:
        """Return the identity of one servo.

        Raises:
            BusError: the servo does not answer.
        """
        return self._info_of(self._exchange(id, Instruction.PING, size=PING_SIZE))

    def _info_of(self, packet: StatusPacket) -> ServoInfo:
        number = int.from_bytes(packet.data[:2], "little")
        names = [model.name for model in MODELS.values() if model.number == number]
        firmware = packet.data[2] if len(packet.data) > 2 else 0
        return ServoInfo(packet.id, number, (*names, "unknown")[0], firmware)

    def _change_identity(self, id: int, name: str, value: int) -> None:
        """Write a register that changes the id or speed of the answer.

        Which of the old and the new one the answer has is not specified.

        Raises:
            ServoRefusalError: the servo refuses the value.
        """
        register = REGISTERS[name]
        data = register.address.to_bytes(2, "little") + register.encode(value)
        self._line.write(encode(id, Instruction.WRITE, data))
        for answer in self._receive(StatusReader(), EXCHANGE_MARGIN, ()):
            self._check_refusal(answer, f"writing {name} = {value}")

    def _listen_once(self, id: int) -> Iterator[tuple[bytes, int]]:
        """Yield what comes back and its valid answers, for each request."""
        margin = self._line.latency + LISTEN_MARGIN
        quiet_time = self._line.latency + QUIET_TIME
        parameters = _span(MEASURED_ADDRESS, MEASURED_SIZE)
        requests = (
            (encode(id, Instruction.PING), PING_SIZE),
            (encode(id, Instruction.READ, parameters), MEASURED_SIZE),
        )
        for packet, size in requests:
            wire_time = self._line.wire_time(len(packet) + STATUS_OVERHEAD + size)
            heard = self._line.ask(packet, wire_time + margin, quiet_time)
            answers = [one for one in _packets_in(heard) if one.id == id]
            yield heard, len(answers)

    def _stored_changes(self, id: int, mode: Mode) -> list[StoredChange]:
        """Changes of registers that keep their value without power.

        Only what differs is written: the memory wears out with every write.
        """
        is_limited = mode is Mode.CURRENT_LIMITED_POSITION
        needed = {
            "drive_mode": 0,
            "operating_mode": CURRENT_LIMITED_POSITION
            if is_limited
            else EXTENDED_POSITION,
            "homing_offset": 0,
        }
        stored = {name: self.read(id, name) for name in needed}
        changes = [
            StoredChange(name, stored[name], value)
            for name, value in needed.items()
            if stored[name] != value
        ]
        delay = self.read(id, "return_delay")
        if delay:
            changes.append(StoredChange("return_delay", delay, 0, is_required=False))
        limit = self.read(id, "current_limit")
        allowed = round(self._max_current / self.model.current_unit)
        if limit > allowed:
            changes.append(StoredChange("current_limit", limit, allowed, False))
        return changes

    def _note_current_limit(self, id: int) -> None:
        """Remember the stored limit, which the servo lets no goal exceed."""
        limit = self.read(id, "current_limit")
        self._current_limits[id] = limit
        if limit < round(self._max_current / self.model.current_unit):
            stored = limit * self.model.current_unit
            self.warn_of_low_limit(id, stored, self._max_current)

    def _write_each(self, ids: Iterable[int], name: str, value: int) -> None:
        """Write the same value to all servos; see `_write_values`."""
        self._write_values(name, dict.fromkeys(ids, value))

    def _write_values(self, name: str, values: Mapping[int, int]) -> None:
        """Write a register of all servos, also after one of them failed.

        Raises:
            BusError: names all servos that failed, with the error of the first.
        """
        failures: dict[int, BusError] = {}
        for id, value in values.items():
            try:
                self.write(id, name, value)
            except PortLostError:
                raise
            except BusError as error:
                failures[id] = error
        if len(failures) > 1:
            raise BusError(f"servos {list(failures)}: {next(iter(failures.values()))}")
        for failure in failures.values():
            raise failure

    def _repeat_goals(self, ids: Iterable[int]) -> None:
        """Write the last goals again, with a confirmation.

        With a lost goal, a servo that is switched on would turn to its old one.

        Raises:
            BusError: a servo does not confirm its goal.
        """
        for id in ids:
            if id in self._goals:
                self.write(id, "goal_position", self._goals[id])

    def _join_state(self, info: ServoInfo) -> None:
        """Let indirect addresses join the registers of `STATE_LAYOUT` to one block."""
        id = info.id
        self._indirect_data[id] = self.model.indirect_data_of(info.firmware)
        addresses: list[int] = []
        for name in STATE_LAYOUT:
            register = REGISTERS[name]
            addresses += range(register.address, register.address + register.size)
        assert len(addresses) <= INDIRECT_COUNT
        start = REGISTERS["indirect_address"].address
        data = start.to_bytes(2, "little")
        for address in addresses:
            data += address.to_bytes(2, "little")
        self._exchange(id, Instruction.WRITE, data, "writing indirect addresses")

    def _sync_write(self, name: str, values: Mapping[int, int]) -> None:
        """Write a register of many servos in one packet, without confirmation."""
        register = REGISTERS[name]
        parameters = _span(register.address, register.size)
        for id, value in values.items():
            parameters += bytes([id]) + register.encode(value)
        self._line.write(encode(BROADCAST, Instruction.SYNC_WRITE, parameters))

    def _count_misses(self, asked: list[int], found: Collection[int]) -> None:
        """Count a miss of the first silent servo, not of those behind it."""
        for id in found:
            self._misses[id] = 0
        missing = [id for id in asked if id not in found]
        if missing:
            self._misses[missing[0]] = self._misses.get(missing[0], 0) + 1

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
        is_joint = self._fast_read and not any(self._misses.get(id) for id in ids)
        instruction = Instruction.SYNC_READ
        if is_joint:
            instruction = Instruction.FAST_SYNC_READ
        parameters = _span(address, STATE_SIZE) + bytes(ids)
        self._line.write(encode(BROADCAST, instruction, parameters))
        expected = len(ids) * (STATUS_OVERHEAD + STATE_SIZE)
        reader = StatusReader(expected if is_joint else 2 * STATE_SIZE)
        duration = self._line.wire_time(len(parameters) + expected)
        found: dict[int, bytes] = {}
        awaited = {BROADCAST} if is_joint else set(ids)
        duration += self._line.latency + CYCLE_MARGIN
        for packet in self._receive(reader, duration, awaited):
            for id, data in _blocks(packet, len(ids)):
                if id in ids and len(data) == STATE_SIZE:
                    found[id] = data
        if len(found) < len(ids):
            self._line.drain(CYCLE_QUIET_TIME)
        return found

    def _state(self, id: int, data: bytes) -> ServoState | None:
        """The state in a joined block; None if the servo has restarted."""
        values = {}
        start = 0
        for name in STATE_LAYOUT:
            register = REGISTERS[name]
            values[name] = register.decode(data[start : start + register.size])
            start += register.size
        if values["status_return_level"] != ANSWER_ALL:
            self.restarted.add(id)
        if id in self.restarted:
            return None
        return ServoState(
            position=values["position"],
            velocity=values["velocity"] * VELOCITY_UNIT,
            current=values["current"] * self.model.current_unit,
            voltage=values["voltage"] * VOLTAGE_UNIT,
            temperature=float(values["temperature"]),
            errors=_hardware_errors(values["hardware_error"]),
            watchdog_tripped=values["watchdog"] == WATCHDOG_TRIPPED,
        )

    def _read(self, id: int, register: Register) -> int:
        parameters = _span(register.address, register.size)
        answer = self._exchange(id, Instruction.READ, parameters, size=register.size)
        return register.decode(answer.data)

    def _exchange(
        self,
        id: int,
        instruction: Instruction,
        parameters: bytes = b"",
        purpose: str = "",
        size: int = 0,
    ) -> StatusPacket:
        """Send an instruction to one servo and return its answer.

        Args:
            id: of the servo.
            instruction: to carry out.
            parameters: of the instruction.
            purpose: description of the access, for the error message.
            size: number of bytes that a read returns.

        Raises:
            ServoRefusalError: the servo refuses the instruction.
            BusError: the servo does not answer.
        """
        packet = encode(id, instruction, parameters)
        count = len(packet) + STATUS_OVERHEAD + size
        duration = self._line.wire_time(count) + self._line.latency + EXCHANGE_MARGIN
        for _ in range(ATTEMPTS):
            self._line.write(packet)
            for answer in self._receive(StatusReader(), duration, {id}):
                self._check_refusal(answer, purpose or instruction.name.lower())
                if answer.id == id and len(answer.data) == size:
                    return answer
            # a late answer must not be taken for that of the next attempt
            self._line.drain(QUIET_TIME)
        if self.listen(id) in (Hearing.DAMAGED, Hearing.DOUBLED):
            raise BusError(f"servo {id} does not answer clearly: {DAMAGED}")
        raise BusError(
            f"servo {id} on {self._line.port} does not answer at "
            f"{self._line.baud_rate} bit/s; check its cable, its power and its id "
            "(`s2c2a motors scan`)"
        )

    def _check_refusal(self, answer: StatusPacket, purpose: str) -> None:
        number = answer.error & ~ALERT
        if number:
            reason = REFUSALS.get(number, f"error {number}")
            raise ServoRefusalError(f"servo {answer.id} refuses {purpose}: {reason}")

    def _receive(
        self, reader: StatusReader, duration: float, awaited: Collection[int]
    ) -> Iterator[StatusPacket]:
        """Yield packets until all awaited servos answered, or the time is over."""
        remaining = set(awaited)
        deadline = time.monotonic() + duration
        while data := self._line.read(deadline):
            for packet in reader.feed(data):
                remaining.discard(packet.id)
                yield packet
            if awaited and not remaining:
                return
            # a line that is never quiet must not block the caller
            if time.monotonic() > deadline:
                break
        yield from reader.flush()


def _packets_in(data: bytes) -> list[StatusPacket]:
    """All valid packets in bytes."""
    reader = StatusReader()
    return [*reader.feed(data), *reader.flush()]


def _span(address: int, size: int) -> bytes:
    """Address and size of a block, as parameters."""
    return address.to_bytes(2, "little") + size.to_bytes(2, "little")


def _blocks(packet: StatusPacket, count: int) -> Iterator[tuple[int, bytes]]:
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
        yield joint[start + 1], joint[start + 2 : start + 2 + STATE_SIZE]


def _hardware_errors(bits: int) -> frozenset[HardwareError]:
    return frozenset(
        HardwareError[name]
        for bit, name in HARDWARE_ERROR_BITS.items()
        if bits & (1 << bit)
    )
