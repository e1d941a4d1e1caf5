"""Interface of a servo bus: registers of servos, goals out, states in.

An implementation knows one protocol; nothing above this interface does. Positions are
in ticks, signed, over several turns. All other values are in SI units, except
temperatures in degrees Celsius.
"""

import itertools
import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar, Self

from s2c2a.arm.servos import MODEL_NUMBERS, WAY_OUT
from s2c2a.errors import S2C2AError

UNKNOWN = "unknown"
"""Name of a model that is not in the tables."""
NO_CURRENT = (
    "these servos measure no current: tensions are missing, and neither slack nor a "
    "contact is found. The limit of the current is one of the voltage, and holds at rest"
)
NO_WATCHDOG = (
    "these servos have no watchdog: if this computer or program fails, they keep their "
    "last goal and their torque. Keep a switch for their power within reach"
)


RESTARTED = (
    "has restarted, as after a loss of power, and forgot its position; check its cable "
    "and the supply, then open the arm again"
)


class BusError(S2C2AError):
    """A servo bus failed: a port, a servo that does not answer, or a refused write."""


class PortLostError(BusError):
    """The serial port is gone: unplugged, or taken by another process."""


class StoredSettingsError(BusError):
    """Servos store settings with which they cannot be driven, and keep them."""


class WrongModelError(BusError):
    """A servo is of another model than the arm file states."""


class ServoRefusalError(BusError):
    """A servo answered with an error: a value or an access that it refuses."""


class HardwareError(Enum):
    """Reasons for which a servo switches its torque off."""

    VOLTAGE = "supply voltage out of range"
    OVERHEATED = "overheated"
    ENCODER = "encoder failure"
    SHOCK = "electrical shock"
    OVERLOAD = "overloaded"


@dataclass(frozen=True)
class ServoInfo:
    """Identity of a servo.

    Attributes:
        id: on the bus.
        model_number: as the servo states it.
        model: name of the model, or "unknown".
        firmware: version.
        secondary_id: another id that it obeys; None without one.
    """

    id: int
    model_number: int
    model: str
    firmware: int
    secondary_id: int | None = None


@dataclass(frozen=True)
class ServoState:
    """Measurements and status of a servo.

    Attributes:
        position: [ticks].
        velocity: [rad/s]; positive where the position grows.
        current: [A]; positive where it drives the position up; NaN if the model
            measures none.
        voltage: of the supply [V].
        temperature: [deg C].
        errors: reasons for which the torque is off.
        watchdog_tripped: whether the servo stopped because no command arrived.
    """

    position: int
    velocity: float
    current: float
    voltage: float
    temperature: float
    errors: frozenset[HardwareError] = frozenset()
    watchdog_tripped: bool = False


ServoStates = dict[int, ServoState]
"""States of servos by their id."""


class Hearing(Enum):
    """What a servo answers when it is asked alone."""

    CLEAR = "one valid answer"
    SILENT = "no answer"
    DAMAGED = "answers that are damaged"
    DOUBLED = "more than one answer"


@dataclass(frozen=True)
class StoredChange:
    """A setting that a servo keeps without power, and its new value.

    Attributes:
        name: of the register.
        old: value in the servo.
        new: value that it gets.
        is_required: whether the servo cannot be driven without the change.
    """

    name: str
    old: int
    new: int
    is_required: bool = True

    def __str__(self) -> str:
        return f"{self.name} {self.old} -> {self.new}"


def refuse(changes: str) -> bool:
    """Keep what servos store: nobody was asked."""
    return False


class ServoBus(ABC):
    """Servos on one serial line. A context manager that closes the port.

    Attributes:
        ticks_per_turn: of the position.
        torque_constant: torque per current [N m/A].
        baud_rates: speeds that the servos can have [bit/s].
        has_watchdog: whether servos stop by themselves without commands.
        has_current: whether servos measure their current.
        accept_stored: gets the changes of settings that servos keep without power, in
            one line, and returns whether they are made. By default none is.
        restarted: ids of servos that lost their settings since `prepare`. They forgot
            their turns: they have no state, no torque, and get no goal before they are
            prepared again.
    """

    ticks_per_turn: int
    has_watchdog: ClassVar[bool] = True
    has_current: bool = True
    torque_constant: float
    baud_rates: tuple[int, ...]
    restarted: set[int]
    accept_stored: Callable[[str], bool] = staticmethod(refuse)

    @abstractmethod
    def scan(self, ids: Iterable[int] = ()) -> list[ServoInfo]:
        """Return the servos that answer at the current baud rate.

        Args:
            ids: servos to ask; all possible ones if empty.
        """

    @abstractmethod
    def set_baud_rate(self, baud_rate: int) -> None:
        """Change the speed of the port, not of the servos."""

    @abstractmethod
    def assign(self, id: int, new_id: int, baud_rate: int) -> None:
        """Store another id and baud rate in a servo; torque must be off.

        Args:
            id: of the servo now.
            new_id: of the servo afterwards.
            baud_rate: of the servo afterwards [bit/s].

        Raises:
            BusError: the id or the baud rate is taken or impossible, or the servo does
                not answer.
        """

    @abstractmethod
    def prepare(self, ids: Iterable[int], current: float, speed: float) -> None:
        """Set settings and limits of servos, and switch their torque off.

        Other servos that obey one of these ids, too, lose torque with them, and are to
        obey their own id alone.
        Nothing is changed if a servo is of another model, or if it needs another stored
        setting that `accept_stored` declines. A stored limit is never raised.

        Args:
            ids: of the servos.
            current: largest current [A].
            speed: largest speed [rad/s].

        Raises:
            BusError: a servo does not answer, or refuses a value.
            WrongModelError: a servo is of another model.
            StoredSettingsError: a change that the servo needs was declined.
        """

    @abstractmethod
    def set_torque(self, ids: Iterable[int], on: bool) -> None:
        """Switch the torque of servos on or off.

        A servo confirms its last goal before it is switched on, and the watchdog of all
        of them runs before the first one has torque.

        Raises:
            BusError: servos do not answer. All others are switched off; when
                switching on, none or only some of them are on.
        """

    @abstractmethod
    def set_current(self, ids: Iterable[int], current: float) -> None:
        """Set the largest current of servos that hold a position.

        Args:
            ids: of the servos.
            current: largest current [A].

        Raises:
            BusError: servos do not answer; all others are set.
        """

    @abstractmethod
    def arm_watchdog(self, ids: Iterable[int], seconds: float) -> None:
        """Let servos stop by themselves when no command arrives for a time.

        Args:
            ids: of the servos.
            seconds: that time; zero switches the watchdog off and clears it.

        Raises:
            BusError: the model has no watchdog.
        """

    @abstractmethod
    def send_goals(self, goals: Mapping[int, int]) -> None:
        """Send goal positions in one packet, without an answer.

        A servo that has restarted gets none, nor does one that may be restarting, if a
        goal would switch it on.

        Args:
            goals: position by id [ticks].

        Raises:
            BusError: a goal is beyond the range of the servos; none is sent.
            PortLostError: the port is gone.
        """

    @abstractmethod
    def read_states(self, ids: Iterable[int]) -> ServoStates:
        """Read the states of servos in one exchange.

        A servo that does not answer in time, whose answer is damaged, or that has
        restarted, is left out; the states of the others are valid.

        Raises:
            PortLostError: the port is gone.
        """

    def read_patiently(self, ids: Sequence[int], seconds: float) -> ServoStates:
        """Read states; ask servos that do not answer again, at least once.

        Args:
            ids: of the servos.
            seconds: time after which no servo is asked again.

        Returns:
            The states of the servos that answered.

        Raises:
            PortLostError: the port is gone.
        """
        end = time.perf_counter() + seconds
        states = self.read_states(ids)
        for attempt in itertools.count():
            missing = [id for id in ids if id not in states]
            if not missing or (attempt and time.perf_counter() > end):
                return states
            states |= self.read_states(missing)
        return states

    def torque_constant_of(self, id: int) -> float:
        """Return the torque per current of a servo [N m/A]."""
        return self.torque_constant

    def stop(self, ids: Sequence[int], seconds: float) -> None:
        """Make the places of servos their goals; those that do not answer go on.

        Args:
            ids: of the servos.
            seconds: time after which no servo is asked again.

        Raises:
            PortLostError: the port is gone.
        """
        states = self.read_patiently(ids, seconds)
        self.send_goals({id: state.position for id, state in states.items()})

    def listen(self, id: int) -> Hearing:
        """Ask one servo alone, and return what comes back."""
        return Hearing.CLEAR if self.scan([id]) else Hearing.SILENT

    def check_model(self, info: ServoInfo, name: str, number: int) -> None:
        """Check that a servo is of the model in the arm file.

        Args:
            info: as the servo states it.
            name: of the model in the arm file.
            number: that servos of this model state.

        Raises:
            WrongModelError: it is not; currents, and so tensions, would be wrong.
        """
        if info.model_number == number:
            return
        advice = "Correct the arm file, or replace the servo"
        if info.model == UNKNOWN:
            numbers = MODEL_NUMBERS["dynamixel"] | MODEL_NUMBERS["feetech"]
            known = ", ".join(f"{one} ({numbers[one]})" for one in numbers)
            advice = f"Known are {known}; replace the servo, {WAY_OUT}"
        raise WrongModelError(
            f"servo {info.id} is of the model {info.model} (number "
            f"{info.model_number}); the arm file has servos.model = '{name}' "
            f"({number}). {advice}; nothing moved"
        )

    def confirm_stored(
        self, changes: Mapping[int, Sequence[StoredChange]]
    ) -> Mapping[int, Sequence[StoredChange]]:
        """Announce changes of stored settings, and return those that are made.

        Args:
            changes: by id of the servo.

        Raises:
            StoredSettingsError: a required change is declined.
        """
        text = _describe_changes(changes)
        if not text or self.accept_stored(text):
            return changes
        if any(change.is_required for row in changes.values() for change in row):
            raise StoredSettingsError(
                f"declined, and nothing was changed: {text}. The servos cannot be driven "
                "without. `s2c2a motors check` (or jog, home) asks, then stores them"
            )
        return {}

    def warn_of_low_limit(self, id: int, stored: float, wanted: float) -> None:
        """Warn that a servo stores a smaller current limit than the arm file [A]."""
        warnings.warn(
            f"servo {id} stores a current limit of {stored:.3g} A, below "
            f"servos.limits.current = {wanted:g} A; the stored limit counts. To raise it, "
            "use the manufacturer's program",
            stacklevel=1,
        )

    @abstractmethod
    def reboot(self, id: int) -> None:
        """Restart a servo: its errors are cleared, its torque is off."""

    @abstractmethod
    def close(self) -> None:
        """Close the port; allowed more than once."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_) -> None:
        self.close()


def _describe_changes(changes: Mapping[int, Sequence[StoredChange]]) -> str:
    """One line; servos with the same changes are named together. Empty without any."""
    groups: dict[str, list[int]] = {}
    for id, row in changes.items():
        if row:
            groups.setdefault(", ".join(map(str, row)), []).append(id)
    parts = [f"servos {ids}: {text}" for text, ids in groups.items()]
    return f"stored settings (EEPROM) of {'; '.join(parts)}" if parts else ""
