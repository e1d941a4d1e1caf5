"""Servo bus of Feetech STS servos."""

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import isfinite

from s2c2a.lab.hardware.bus import (
    BusError,
    HardwareError,
    Hearing,
    Mode,
    ServoBus,
    ServoInfo,
    ServoState,
    StoredChange,
)
from s2c2a.lab.hardware.feetech import packets, tables
from s2c2a.lab.hardware.feetech.packets import (
    OVERHEAD,
    Answer,
    take_answers,
    value_in_block,
)
from s2c2a.lab.hardware.feetech.tables import Register
from s2c2a.lab.hardware.feetech.turns import TurnCounter
from s2c2a.lab.hardware.presence import DAMAGED, hear
from s2c2a.lab.hardware.serial_line import SerialLine

ATTEMPTS = 3
"""Attempts to read or write a register of one servo; noise spoils single packets."""
REPLY_TIMEOUT = 0.02
"""Longest wait for answers beyond the time on the line [s]; many USB adapters keep
bytes for up to 16 ms, and no file states it."""
PATIENT_TIMEOUT = 0.1
"""The same outside of a control cycle [s]."""
LISTEN_TIMEOUT = 0.03
"""The same, to find out whether a servo is there [s]."""
NEEDED = {
    "status_level": (tables.STATUS_LEVEL, 1),
    "min_angle": (tables.MIN_ANGLE, 0),
    "max_angle": (tables.MAX_ANGLE, 0),
    "mode": (tables.MODE, 0),
}
"""Settings in EPROM that positions over several turns need, by name for users."""
STORED = {name: register for name, (register, _) in NEEDED.items()} | {
    "return_delay": tables.RETURN_DELAY,
    "max_torque": tables.MAX_TORQUE,
    "phase": tables.PHASE,
}
"""All settings in EPROM that `prepare` may change."""


class FeetechBus(ServoBus):
    """Feetech STS servos on one serial port.

    Positions. `prepare` asks a servo to report its position over several turns (phase,
    bit 4). If it does not take that setting, or before `prepare`, positions are
    unwrapped from the first one that this bus reads, so goals are right only if the
    servo counts its turns from there, too: after a power-up. A servo forgets its turns
    when it loses power.

    Current. Servos limit their torque (register 48) in per mille of the stall torque;
    the current limit is that part of the stall current. The sign of the current is that
    of the load register, since not every firmware signs the current. A voltage other
    than the rated one changes both by its ratio.

    Torque. A servo that receives a goal switches its torque on by itself. Goals of
    servos whose torque this bus has switched off are therefore kept back until it is
    switched on.

    Restart. A servo that restarts loses its limits, which come with every state. Since
    a goal would switch it on and turn it by whole turns, it gets none before the next
    `prepare`; nor does a servo that did not answer last, which may be restarting.

    Attributes:
        ticks_per_turn: 4096.
        torque_constant: stall torque per stall current [N m/A].
        baud_rates: of the servos [bit/s].
        restarted: see `ServoBus`.
    """

    ticks_per_turn = tables.TICKS_PER_TURN
    baud_rates = tuple(tables.BAUD_CODES)
    has_watchdog = False

    def __init__(
        self,
        port: str,
        baud_rate: int,
        model: str = "sts3215",
        max_current: float | None = None,
    ):
        """Open a port.

        Args:
            port: such as /dev/ttyUSB0.
            baud_rate: of the port and the servos [bit/s].
            model: "sts3215" (7.4 V) or "sts3215-12v"; both state the same number.
            max_current: largest current of any motion [A]; by default the stall
                current.

        Raises:
            BusError: an unknown model or baud rate, a port that does not exist, or one
                that another process has opened.
        """
        if model not in tables.MODELS:
            raise BusError(
                f"the Feetech model '{model}' is unknown; choose one of "
                f"{', '.join(tables.MODELS)}"
            )
        _baud_code(baud_rate)
        self._name = model
        self._model = tables.MODELS[model]
        stall_current = self._model.stall_current
        self._max_current = min(max_current or stall_current, stall_current)
        self._torque_limits: dict[int, int] = {}
        self.torque_constant = self._model.torque_constant
        self._turns = TurnCounter(self.ticks_per_turn)
        self._phases: dict[int, int] = {}
        self._kept_goals: dict[int, int | None] = {}
        self._speeds: dict[int, int] = {}
        self._silent: set[int] = set()
        self.restarted: set[int] = set()
        self._line = SerialLine(port, baud_rate)

    def scan(self, ids: Iterable[int] = ()) -> list[ServoInfo]:
        """See `ServoBus`; without ids it takes about six seconds."""
        asked = tuple(ids) or range(tables.MAX_ID + 1)
        found = (self._identify(id) for id in asked)
        return [info for info in found if info is not None]

    def set_baud_rate(self, baud_rate: int) -> None:
        """See `ServoBus`.

        Raises:
            BusError: servos have no such baud rate.
        """
        _baud_code(baud_rate)
        self._line.baud_rate = baud_rate

    def assign(self, id: int, new_id: int, baud_rate: int) -> None:
        """See `ServoBus`.

        Raises:
            BusError: the new id or baud rate is impossible or taken, the torque is on,
                or the servo does not answer afterwards.
        """
        code = _baud_code(baud_rate)
        self._check_assignment(id, new_id)
        self._write(id, tables.LOCK, 0)
        # which id or rate the answer has depends on the firmware: none is awaited
        self._line.write(packets.write_packet(id, tables.ID, new_id))
        self._read(new_id, tables.IDENTITY_BLOCK)
        if baud_rate == self._line.baud_rate:
            self._store(new_id, tables.BAUD_RATE, code)
        else:
            self._line.write(packets.write_packet(new_id, tables.BAUD_RATE, code))
            self._lock_at_new_rate(new_id, baud_rate)

    def prepare(
        self, ids: Iterable[int], mode: Mode, current: float, speed: float
    ) -> None:
        """See `ServoBus`; both modes limit the current.

        Raises:
            BusError: a servo does not answer, or a limit is not a positive number.
        """
        _positive(current, "current")
        _positive(speed, "speed")
        ids = tuple(ids)
        for id in ids:
            self._check_identity(id)
        changes = {id: self._stored_changes(id) for id in ids}
        accepted = self.confirm_stored(changes)
        self.set_torque(ids, False)
        self._turns.forget(ids)
        self.restarted -= set(ids)
        for id in ids:
            self._store_changes(id, accepted.get(id, ()))
            self._write(id, tables.ACCELERATION, 0)
            self._write(id, tables.GOAL_TIME, 0)
            self._speeds[id] = self._speed_value(id, speed)
            self._write(id, tables.GOAL_SPEED, self._speeds[id])
        self.set_current(ids, current)

    def set_torque(self, ids: Iterable[int], on: bool) -> None:
        """See `ServoBus`.

        A servo that is switched on goes to the last goal that it was sent while off, or
        stays where it is.

        Raises:
            BusError: servos do not answer. All others are switched off; when switching
                on, none or only some of them are on.
        """
        ids = tuple(ids)
        if on:
            self._release_goals(ids)
        else:
            self._kept_goals |= dict.fromkeys(ids)
            # at once; an absent servo does not delay the others
            off = dict.fromkeys(ids, 0)
            self._line.write(packets.sync_write_packet(off, tables.TORQUE_ENABLE))
        self._write_values(tables.TORQUE_ENABLE, dict.fromkeys(ids, int(on)))

    def set_current(self, ids: Iterable[int], current: float) -> None:
        """See `ServoBus`; a larger current than the stall current is no limit.

        Raises:
            BusError: servos do not answer, or the current is not a positive number.
        """
        part = _positive(current, "current") / self._model.stall_current
        value = round(tables.FULL_TORQUE * min(part, 1.0))
        limits = {id: self._torque_limits.get(id, value) for id in ids}
        values = {id: max(min(value, limit), 1) for id, limit in limits.items()}
        self._write_values(tables.TORQUE_LIMIT, values)

    def arm_watchdog(self, ids: Iterable[int], seconds: float) -> None:
        """Raise an error: these servos have no watchdog.

        Raises:
            BusError: always.
        """
        raise BusError(
            "STS servos have no watchdog: without commands they keep their goal; "
            "limit their current, and switch the supply off in an emergency"
        )

    def send_goals(self, goals: Mapping[int, int]) -> None:
        """See `ServoBus`.

        Raises:
            BusError: a goal exceeds +-32767 ticks; nothing is sent.
            PortLostError: the port is gone.
        """
        # refuses an impossible goal of any servo
        packets.sync_write_packet(goals, tables.GOAL_POSITION)
        kept = goals.keys() & self._kept_goals.keys()
        self._kept_goals |= {id: goals[id] for id in kept}
        barred = kept | self._silent | self.restarted
        sent = {id: goal for id, goal in goals.items() if id not in barred}
        if sent:
            packet = packets.sync_write_packet(sent, tables.GOAL_POSITION)
            self._line.write(packet)

    def read_states(self, ids: Iterable[int]) -> dict[int, ServoState]:
        """See `ServoBus`."""
        ids = tuple(ids)
        if not ids:
            return {}
        block = tables.STATE_BLOCK
        packet = packets.sync_read_packet(ids, block)
        answers = self._exchange(packet, ids, block.size)
        self._silent = (self._silent | set(ids)) - answers.keys()
        self.restarted |= {
            id for id, answer in answers.items() if self._has_restarted(answer)
        }
        return {
            id: self._state(answer)
            for id, answer in answers.items()
            if id not in self.restarted
        }

    def listen(self, id: int) -> Hearing:
        """Ask one servo for its identity and its measurements; see `ServoBus`."""
        return hear(lambda: self._listen_once(id), ATTEMPTS)

    def reboot(self, id: int) -> None:
        """Switch the torque off, which clears an overload.

        These servos have no restart instruction; other errors end with their cause.

        Raises:
            BusError: the servo does not answer, or an error remains.
        """
        self.set_torque((id,), False)
        self._turns.forget((id,))
        status = packets.decode_value(self._read(id, tables.STATUS).data, tables.STATUS)
        errors = _errors(status)
        if errors:
            names = ", ".join(sorted(error.value for error in errors))
            raise BusError(
                f"servo {id} still reports: {names}; remove the cause, or switch its "
                "supply off and on"
            )

    def close(self) -> None:
        """See `ServoBus`."""
        self._line.close()

    def _exchange(
        self,
        packet: bytes,
        ids: Sequence[int],
        size: int,
        timeout: float = REPLY_TIMEOUT,
    ) -> dict[int, Answer]:
        """Send a packet and return the valid answers by id.

        Servos answer in the order of their ids: the exchange ends with the answer of
        the last one. Any number of absent servos costs one timeout at most.

        Args:
            packet: instruction.
            ids: of the servos that answer, in their order.
            size: of the data in each answer [bytes].
            timeout: longest wait beyond the time on the line [s].

        Raises:
            PortLostError: the port is gone.
        """
        answers: dict[int, Answer] = {}
        buffer = bytearray()
        count = len(packet) + len(ids) * (size + OVERHEAD)
        duration = self._line.wire_time(count) + self._line.latency + timeout
        self._line.write(packet)
        deadline = time.monotonic() + duration
        while ids[-1] not in answers and (data := self._line.read(deadline)):
            buffer += data
            for answer in take_answers(buffer, set(ids), size):
                answers[answer.id] = answer
            # a line that is never quiet must not block the caller
            if time.monotonic() > deadline:
                break
        return answers

    def _identify(self, id: int) -> ServoInfo | None:
        # no ping: its answer can equal its echo
        block = tables.IDENTITY_BLOCK
        answers = self._exchange(packets.read_packet(id, block), (id,), block.size)
        if id not in answers:
            return None
        return _info_of(id, answers[id].data)

    def _check_assignment(self, id: int, new_id: int) -> None:
        if not 0 <= new_id <= tables.MAX_ID:
            raise BusError(f"the new id is {new_id}; choose 0 to {tables.MAX_ID}")
        if self._read(id, tables.TORQUE_ENABLE).data != b"\0":
            raise BusError(f"the torque of servo {id} is on; switch it off first")
        if new_id != id and self._identify(new_id) is not None:
            raise BusError(f"another servo has the id {new_id}; choose a free one")

    def _lock_at_new_rate(self, id: int, baud_rate: int) -> None:
        """Lock the EPROM; some firmware changes its rate only at the next power-up."""
        old_rate = self._line.baud_rate
        self._line.baud_rate = baud_rate
        try:
            if self._identify(id) is None:
                self._line.baud_rate = old_rate
            self._write(id, tables.LOCK, 1)
        finally:
            self._line.baud_rate = old_rate

    def _listen_once(self, id: int) -> Iterator[tuple[bytes, int]]:
        """Yield what comes back and its valid answers, for each request."""
        # the identity, and measurements that no two servos share
        for block in (tables.IDENTITY_BLOCK, tables.STATE_BLOCK):
            packet = packets.read_packet(id, block)
            wire_time = self._line.wire_time(len(packet) + block.size + OVERHEAD)
            patience = wire_time + self._line.latency + LISTEN_TIMEOUT
            quiet_time = self._line.latency + LISTEN_TIMEOUT
            heard = self._line.ask(packet, patience, quiet_time)
            answers = take_answers(bytearray(heard), {id}, block.size)
            yield heard, len(answers)

    def _check_identity(self, id: int) -> None:
        """Check the model of a servo.

        Raises:
            WrongModelError: it is another one.
        """
        data = self._read(id, tables.IDENTITY_BLOCK).data
        self.check_model(_info_of(id, data), self._name, self._model.number)

    def _stored_changes(self, id: int) -> list[StoredChange]:
        """Changes in EPROM; only what differs is written."""
        block = tables.SETTINGS_BLOCK
        data = self._read(id, block).data
        stored = {
            name: value_in_block(data, block, register)
            for name, register in STORED.items()
        }
        changes = [
            StoredChange(name, stored[name], value)
            for name, (_, value) in NEEDED.items()
            if stored[name] != value
        ]
        # some firmware does not take the phase: it must not be needed
        wanted = {
            "return_delay": 0,
            "phase": stored["phase"] | tables.PHASE_FULL_ANGLE,
            "max_torque": min(stored["max_torque"], self._torque_value()),
        }
        changes += [
            StoredChange(name, stored[name], value, is_required=False)
            for name, value in wanted.items()
            if stored[name] != value
        ]
        return changes

    def _store_changes(self, id: int, changes: Sequence[StoredChange]) -> None:
        for change in changes:
            self._write(id, tables.LOCK, 0)
            self._store(id, STORED[change.name], change.new)
        block = tables.SETTINGS_BLOCK
        data = self._read(id, block).data
        self._phases[id] = value_in_block(data, block, tables.PHASE)
        limit = value_in_block(data, block, tables.MAX_TORQUE)
        self._torque_limits[id] = limit
        if limit < self._torque_value():
            stored = limit / tables.FULL_TORQUE * self._model.stall_current
            self.warn_of_low_limit(id, stored, self._max_current)

    def _torque_value(self) -> int:
        """Largest torque of any motion, as the servo counts it."""
        share = self._max_current / self._model.stall_current
        return max(round(tables.FULL_TORQUE * share), 1)

    def _store(self, id: int, register: Register, value: int) -> None:
        """Write to an unlocked EPROM, and lock it."""
        self._write(id, register, value)
        self._write(id, tables.LOCK, 1)

    def _release_goals(self, ids: tuple[int, ...]) -> None:
        """Write the goals that were kept back; servos without one stay in place.

        Raises:
            BusError: a servo does not answer; it and those after it stay off.
        """
        kept = {id: self._kept_goals[id] for id in ids if id in self._kept_goals}
        unknown = [id for id, goal in kept.items() if goal is None]
        states = self.read_states(unknown)
        missing = [id for id in unknown if id not in states]
        if missing:
            raise _absent(missing)
        goals = {id: state.position for id, state in states.items()}
        goals |= {id: goal for id, goal in kept.items() if goal is not None}
        for id, goal in goals.items():
            # confirmed: with a lost goal, the servo would turn to its old one
            self._write(id, tables.GOAL_POSITION, goal)
            del self._kept_goals[id]

    def _has_restarted(self, answer: Answer) -> bool:
        """Whether a servo lost the speed that it was prepared with."""
        speed = value_in_block(answer.data, tables.STATE_BLOCK, tables.GOAL_SPEED)
        return speed != self._speeds.get(answer.id, speed)

    def _state(self, answer: Answer) -> ServoState:
        def value(register: Register) -> int:
            return value_in_block(answer.data, tables.STATE_BLOCK, register)

        position = value(tables.PRESENT_POSITION)
        if not self._phase(answer.id) & tables.PHASE_FULL_ANGLE:
            position = self._turns.unwrap(answer.id, position)
        steps = value(tables.PRESENT_SPEED) * self._steps_per_unit(answer.id)
        current = abs(value(tables.PRESENT_CURRENT)) * tables.CURRENT_UNIT
        return ServoState(
            position=position,
            velocity=steps * tables.TICK_SPEED,
            current=-current if value(tables.PRESENT_LOAD) < 0 else current,
            voltage=value(tables.PRESENT_VOLTAGE) * tables.VOLTAGE_UNIT,
            temperature=float(value(tables.PRESENT_TEMPERATURE)),
            errors=_errors(answer.error | value(tables.STATUS)),
        )

    def _phase(self, id: int) -> int:
        """Phase register of a servo; before `prepare`, the factory's."""
        return self._phases.get(id, tables.PHASE_FINE_SPEED)

    def _steps_per_unit(self, id: int) -> int:
        """Unit of the speeds of a servo [steps/s]."""
        is_fine = self._phase(id) & tables.PHASE_FINE_SPEED
        return 1 if is_fine else tables.COARSE_SPEED_STEPS

    def _speed_value(self, id: int, speed: float) -> int:
        """Speed as the servo counts it, at least one unit: zero can mean no limit."""
        steps = _positive(speed, "speed") / tables.TICK_SPEED
        value = min(steps / self._steps_per_unit(id), tables.MAX_SPEED)
        return max(int(value), 1)

    def _read(self, id: int, register: Register) -> Answer:
        packet = packets.read_packet(id, register)
        return self._answer(id, packet, register.size)

    def _write(self, id: int, register: Register, value: int) -> None:
        self._answer(id, packets.write_packet(id, register, value), 0)

    def _write_values(self, register: Register, values: Mapping[int, int]) -> None:
        """Write a register of all servos, also after one of them failed."""
        missing = []
        for id, value in values.items():
            packet = packets.write_packet(id, register, value)
            if self._attempt(id, packet, 0) is None:
                missing.append(id)
        if missing:
            raise _absent(missing)

    def _answer(self, id: int, packet: bytes, size: int) -> Answer:
        answer = self._attempt(id, packet, size)
        if answer is not None:
            return answer
        if self.listen(id) in (Hearing.DAMAGED, Hearing.DOUBLED):
            raise BusError(f"servo {id} does not answer clearly: {DAMAGED}")
        raise _absent([id])

    def _attempt(self, id: int, packet: bytes, size: int) -> Answer | None:
        for _ in range(ATTEMPTS):
            answers = self._exchange(packet, (id,), size, PATIENT_TIMEOUT)
            if id in answers:
                return answers[id]
        return None


def _baud_code(baud_rate: int) -> int:
    if baud_rate not in tables.BAUD_CODES:
        raise BusError(
            f"Feetech servos have no baud rate {baud_rate}; choose one of "
            f"{', '.join(map(str, tables.BAUD_CODES))}"
        )
    return tables.BAUD_CODES[baud_rate]


def _positive(value: float, name: str) -> float:
    if not isfinite(value) or value <= 0:
        raise BusError(f"a limit of {name} must be positive and finite, got {value}")
    return value


def _errors(bits: int) -> frozenset[HardwareError]:
    return frozenset(error for bit, error in tables.ERROR_BITS.items() if bits & bit)


def _info_of(id: int, data: bytes) -> ServoInfo:
    """Identity of a servo, from `tables.IDENTITY_BLOCK`."""
    (major, minor, _) = data[:3]
    number = int.from_bytes(data[3:], "little")
    model = tables.MODEL_NAMES.get(number, "unknown")
    return ServoInfo(id, number, model, 100 * major + minor)


def _absent(ids: list[int]) -> BusError:
    return BusError(
        f"servos {ids} do not answer; check supply, cables, ids and baud rate"
    )
