"""Servo bus of Feetech STS servos."""

import time
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite

from s2c2a.hardware.bus import (
    BusError,
    HardwareError,
    Mode,
    ServoBus,
    ServoInfo,
    ServoState,
)
from s2c2a.hardware.feetech import packets, tables
from s2c2a.hardware.feetech.packets import (
    OVERHEAD,
    Answer,
    take_answers,
    value_in_block,
)
from s2c2a.hardware.feetech.tables import Register
from s2c2a.hardware.feetech.turns import TurnCounter
from s2c2a.hardware.serial_line import SerialLine

ATTEMPTS = 3
"""Attempts to read or write a register of one servo; noise spoils single packets."""
REPLY_TIMEOUT = 0.02
"""Longest wait for answers beyond the time on the line [s]; many USB adapters keep
bytes for up to 16 ms, and no file states it."""
PATIENT_TIMEOUT = 0.1
"""The same outside of a control cycle [s]."""
SETTINGS = {
    tables.RETURN_DELAY: 0,
    tables.STATUS_LEVEL: 1,
    tables.MIN_ANGLE: 0,
    tables.MAX_ANGLE: 0,
    tables.MODE: 0,
}
"""Settings in EPROM of a position over several turns."""


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

    def __init__(self, port: str, baud_rate: int, model: str = "sts3215"):
        """Open a port.

        Args:
            port: such as /dev/ttyUSB0.
            baud_rate: of the port and the servos [bit/s].
            model: "sts3215" (7.4 V) or "sts3215-12v".

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
        self._model = tables.MODELS[model]
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
        ids = tuple(ids)
        self.set_torque(ids, False)
        self._turns.forget(ids)
        self.restarted -= set(ids)
        for id in ids:
            self._prepare_settings(id)
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
        self._write_each(ids, tables.TORQUE_ENABLE, int(on))

    def set_current(self, ids: Iterable[int], current: float) -> None:
        """See `ServoBus`; a larger current than the stall current is no limit.

        Raises:
            BusError: servos do not answer, or the current is not a positive number.
        """
        part = _positive(current, "current") / self._model.stall_current
        value = round(tables.FULL_TORQUE * min(part, 1.0))
        self._write_each(ids, tables.TORQUE_LIMIT, max(value, 1))

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
        (major, minor, _) = answers[id].data[:3]
        number = int.from_bytes(answers[id].data[3:], "little")
        model = tables.MODEL_NAMES.get(number, "unknown")
        return ServoInfo(id, number, model, 100 * major + minor)

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

    def _prepare_settings(self, id: int) -> None:
        """Store the settings in EPROM that differ."""
        block = tables.SETTINGS_BLOCK
        data = self._read(id, block).data
        phase = value_in_block(data, block, tables.PHASE) | tables.PHASE_FULL_ANGLE
        for register, value in {**SETTINGS, tables.PHASE: phase}.items():
            if value_in_block(data, block, register) != value:
                self._write(id, tables.LOCK, 0)
                self._store(id, register, value)
        self._phases[id] = self._read(id, tables.PHASE).data[0]

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

    def _write_each(self, ids: Iterable[int], register: Register, value: int) -> None:
        """Write a register of all servos, also after one of them failed."""
        missing = []
        for id in ids:
            packet = packets.write_packet(id, register, value)
            if self._attempt(id, packet, 0) is None:
                missing.append(id)
        if missing:
            raise _absent(missing)

    def _answer(self, id: int, packet: bytes, size: int) -> Answer:
        answer = self._attempt(id, packet, size)
        if answer is None:
            raise _absent([id])
        return answer

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


def _absent(ids: list[int]) -> BusError:
    return BusError(
        f"servos {ids} do not answer; check supply, cables, ids and baud rate"
    )
