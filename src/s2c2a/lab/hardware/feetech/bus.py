"""Servo bus of Feetech STS servos."""

from collections.abc import Iterable, Mapping, Sequence

from s2c2a.lab.hardware.bus import (
    BusError,
    HardwareError,
    ServoInfo,
    ServoState,
    StoredChange,
)
from s2c2a.lab.hardware.feetech import tables
from s2c2a.lab.hardware.feetech.packets import FeetechPackets
from s2c2a.lab.hardware.feetech.tables import REGISTERS
from s2c2a.lab.hardware.feetech.turns import TurnCounter
from s2c2a.lab.hardware.packets import Answer, Register
from s2c2a.lab.hardware.serial_bus import CYCLE_MARGIN, SerialBus, stored_changes
from s2c2a.lab.hardware.serial_line import SerialLine

NEEDED = {"status_level": 1, "min_angle": 0, "max_angle": 0, "mode": 0}
"""Settings in EPROM that positions over several turns need, by name for users."""


class FeetechBus(SerialBus):
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

    Restart. A servo that restarts loses its limits, which come with every state. A goal
    would switch it on and turn it by whole turns, so none is sent to a servo without a
    sound answer to the last read, which may be restarting.
    """

    brand = "Feetech"
    packets = FeetechPackets()
    registers = REGISTERS
    models = tables.MODELS
    baud_rates = tables.BAUD_RATES
    limit_register = "torque_limit"
    has_watchdog = False

    def __init__(
        self,
        port: str,
        baud_rate: int,
        model: str = "sts3215",
        max_current: float | None = None,
        line: SerialLine | None = None,
    ):
        """Open a port.

        Args:
            port: such as /dev/ttyUSB0.
            baud_rate: of the port and the servos [bit/s].
            model: "sts3215" (7.4 V) or "sts3215-12v"; both state the same number.
            max_current: largest current of any motion [A]; by default the stall
                current.
            line: see `SerialBus`.

        Raises:
            BusError: an unknown model or baud rate, a port that does not exist, or one
                that another process has opened.
        """
        super().__init__(port, baud_rate, model, max_current, line)
        self._turns = TurnCounter(self.ticks_per_turn)
        self._phases: dict[int, int] = {}
        self._kept_goals: dict[int, int | None] = {}
        self._speeds: dict[int, int] = {}
        self._silent: set[int] = set()

    def scan(self, ids: Iterable[int] = ()) -> list[ServoInfo]:
        """See `ServoBus`; without ids it takes about six seconds."""
        asked = tuple(ids) or range(tables.MAX_ID + 1)
        found = (self._identify(id) for id in asked)
        return [info for info in found if info is not None]

    def assign(self, id: int, new_id: int, baud_rate: int) -> None:
        """See `ServoBus`.

        Raises:
            BusError: the new id or baud rate is impossible or taken, the torque is on,
                or the servo does not answer afterwards.
        """
        code = self._baud_code(baud_rate)
        if not 0 <= new_id <= tables.MAX_ID:
            raise BusError(f"the new id is {new_id}; choose 0 to {tables.MAX_ID}")
        if self.read(id, "torque"):
            raise BusError(f"the torque of servo {id} is on; switch it off first")
        if new_id != id and self._identify(new_id) is not None:
            raise BusError(f"another servo has the id {new_id}; choose a free one")
        self.write(id, "lock", 0)
        # which id or rate the answer has depends on the firmware: none is awaited
        self._line.write(self.packets.write(id, REGISTERS["id"], new_id))
        self.info(new_id)
        if baud_rate == self._line.baud_rate:
            self._store(new_id, "baud_rate", code)
        else:
            self._line.write(self.packets.write(new_id, REGISTERS["baud_rate"], code))
            # lock the EPROM; some firmware changes its rate only at the next power-up
            old_rate = self._line.baud_rate
            self._line.baud_rate = baud_rate
            try:
                if self._identify(new_id) is None:
                    self._line.baud_rate = old_rate
                self.write(new_id, "lock", 1)
            finally:
                self._line.baud_rate = old_rate

    def prepare(self, ids: Iterable[int], current: float, speed: float) -> None:
        """See `ServoBus`; the current is limited last, once the servos are ready.

        Raises:
            BusError: a servo does not answer, or a limit is not a positive number.
        """
        ids = tuple(ids)
        super().prepare(ids, current, speed)
        self.set_current(ids, current)

    def _prepare_one(
        self,
        info: ServoInfo,
        changes: Sequence[StoredChange],
        current: float,
        speed: float,
    ) -> None:
        id = info.id
        self._turns.forget((id,))
        for change in changes:
            self.write(id, "lock", 0)
            self._store(id, change.name, change.new)
        stored = self._settings(id)
        self._phases[id] = stored["phase"]
        self._note_stored_limit(id, stored["max_torque"])
        self.write(id, "acceleration", 0)
        self.write(id, "goal_time", 0)
        # speed as the servo counts it, at least one unit: zero can mean no limit
        steps = speed / tables.TICK_SPEED
        value = min(steps / self._steps_per_unit(id), tables.MAX_SPEED)
        self._speeds[id] = max(int(value), 1)
        self.write(id, "goal_speed", self._speeds[id])

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
            # write the goals that were kept back; servos without one stay in place
            kept = [id for id in ids if id in self._kept_goals]
            for id, state in self._checked_states(kept).items():
                goal = self._kept_goals[id]
                # confirmed: with a lost goal, the servo would turn to its old one
                self.write(
                    id, "goal_position", state.position if goal is None else goal
                )
                del self._kept_goals[id]
        else:
            self._kept_goals |= dict.fromkeys(ids)
            # at once; an absent servo does not delay the others
            self._sync_write("torque", dict.fromkeys(ids, 0))
        self._write_values("torque", dict.fromkeys(ids, int(on)))

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
        self.packets.sync_write(goals, REGISTERS["goal_position"])
        kept = goals.keys() & self._kept_goals.keys()
        self._kept_goals |= {id: goals[id] for id in kept}
        barred = kept | self._silent | self.restarted
        sent = {id: goal for id, goal in goals.items() if id not in barred}
        self._sync_write("goal_position", sent)

    def _read_states(self, ids: Sequence[int]) -> dict[int, ServoState | None]:
        if not ids:
            return {}
        block = REGISTERS["state"]
        answers = self._answers(self.packets.sync_read(ids, block), ids, block)
        states = {id: self._state(answer) for id, answer in answers.items()}
        sound = {id for id, state in states.items() if state is not None}
        self._silent = (self._silent | set(ids)) - sound
        return states

    def reboot(self, id: int) -> None:
        """Switch the torque off, which clears an overload.

        These servos have no restart instruction; other errors end with their cause.

        Raises:
            BusError: the servo does not answer, or an error remains.
        """
        self.set_torque((id,), False)
        self._turns.forget((id,))
        errors = _errors(self.read(id, "status"))
        if errors:
            names = ", ".join(sorted(error.value for error in errors))
            raise BusError(
                f"servo {id} still reports: {names}; remove the cause, or switch its "
                "supply off and on"
            )

    def info(self, id: int) -> ServoInfo:
        return _info_of(id, self._read(id, REGISTERS["identity"]))

    def _answers(
        self, packet: bytes, ids: Sequence[int], block: Register
    ) -> dict[int, Answer]:
        """Read a block of servos, once; those that answer, by id.

        Servos answer in the order of their ids: the exchange ends with the answer of
        the last one. Any number of absent servos costs one timeout at most.
        """
        reader = self.packets.reader(set(ids), block.size)
        answers = self._exchange(
            packet, reader, block.size, CYCLE_MARGIN, ids[-1:], len(ids)
        )
        return {answer.id: answer for answer in answers}

    def _identify(self, id: int) -> ServoInfo | None:
        # no ping: its answer can equal its echo
        block = REGISTERS["identity"]
        answers = self._answers(self.packets.read(id, block), (id,), block)
        return _info_of(id, answers[id].data) if answers else None

    def _probes(self, id: int) -> Sequence[tuple[bytes, int]]:
        # the identity, and measurements that no two servos share
        blocks = (REGISTERS["identity"], REGISTERS["state"])
        return [(self.packets.read(id, block), block.size) for block in blocks]

    def _stored_changes(self, id: int) -> list[StoredChange]:
        stored = self._settings(id)
        allowed = self._current_units(self._max_current)
        # some firmware does not take the phase: it must not be needed
        wanted = {
            "return_delay": 0,
            "phase": stored["phase"] | tables.PHASE_FULL_ANGLE,
            "max_torque": min(stored["max_torque"], allowed),
        }
        return stored_changes(stored, NEEDED, wanted)

    def _settings(self, id: int) -> dict[str, int]:
        """All settings in EPROM that `prepare` may change."""
        block = REGISTERS["settings"]
        data = self._read(id, block)
        names = (*NEEDED, "return_delay", "phase", "max_torque")
        return {name: REGISTERS[name].within(data, block) for name in names}

    def _store(self, id: int, name: str, value: int) -> None:
        """Write to an unlocked EPROM, and lock it."""
        self.write(id, name, value)
        self.write(id, "lock", 1)

    def _state(self, answer: Answer) -> ServoState | None:
        """The state; None of a servo that lost the speed of `prepare`."""
        speed = _value(answer, "goal_speed")
        if speed != self._speeds.get(answer.id, speed):
            return None
        position = _value(answer, "position")
        if not self._phase(answer.id) & tables.PHASE_FULL_ANGLE:
            position = self._turns.unwrap(answer.id, position)
        steps = _value(answer, "speed") * self._steps_per_unit(answer.id)
        current = abs(_value(answer, "current")) * tables.CURRENT_UNIT
        return ServoState(
            position=position,
            velocity=steps * tables.TICK_SPEED,
            current=-current if _value(answer, "load") < 0 else current,
            voltage=_value(answer, "voltage") * tables.VOLTAGE_UNIT,
            temperature=float(_value(answer, "temperature")),
            errors=_errors(answer.error | _value(answer, "status")),
        )

    def _phase(self, id: int) -> int:
        """Phase register of a servo; before `prepare`, the factory's."""
        return self._phases.get(id, tables.PHASE_FINE_SPEED)

    def _steps_per_unit(self, id: int) -> int:
        """Unit of the speeds of a servo [steps/s]."""
        is_fine = self._phase(id) & tables.PHASE_FINE_SPEED
        return 1 if is_fine else tables.COARSE_SPEED_STEPS


def _value(answer: Answer, name: str) -> int:
    """A value in the block `state`."""
    return REGISTERS[name].within(answer.data, REGISTERS["state"])


def _errors(bits: int) -> frozenset[HardwareError]:
    return frozenset(error for bit, error in tables.ERROR_BITS.items() if bits & bit)


def _info_of(id: int, data: bytes) -> ServoInfo:
    """Identity of a servo, from `tables.IDENTITY_BLOCK`."""
    (major, minor, _) = data[:3]
    number = int.from_bytes(data[3:], "little")
    model = tables.MODEL_NAMES.get(number, "unknown")
    return ServoInfo(id, number, model, 100 * major + minor)
