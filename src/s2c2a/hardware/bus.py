"""Interface of a servo bus: registers of servos, goals out, states in.

An implementation knows one protocol; nothing above this interface does. Positions are
in ticks, signed, over several turns. All other values are in SI units, except
temperatures in degrees Celsius.
"""

import itertools
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar, Self

from s2c2a.errors import S2C2AError

NO_WATCHDOG = (
    "these servos have no watchdog: if this computer or program fails, they keep their "
    "last goal and their torque. Keep a switch for their power within reach"
)


class BusError(S2C2AError):
    """A servo bus failed: a port, a servo that does not answer, or a refused write."""


class PortLostError(BusError):
    """The serial port is gone: unplugged, or taken by another process."""


class ServoRefusalError(BusError):
    """A servo answered with an error: a value or an access that it refuses."""


class Mode(Enum):
    """Operating modes that cables need."""

    POSITION = "position over several turns"
    CURRENT_LIMITED_POSITION = "position over several turns, with a limited current"


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
    """

    id: int
    model_number: int
    model: str
    firmware: int


@dataclass(frozen=True)
class ServoState:
    """Measurements and status of a servo.

    Attributes:
        position: [ticks].
        velocity: [rad/s]; positive where the position grows.
        current: [A]; positive where it drives the position up.
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


class ServoBus(ABC):
    """Servos on one serial line. A context manager that closes the port.

    Attributes:
        ticks_per_turn: of the position.
        torque_constant: torque per current [N m/A].
        baud_rates: speeds that the servos can have [bit/s].
        has_watchdog: whether servos stop by themselves without commands.
        restarted: ids of servos that lost their settings since `prepare`. They forgot
            their turns: they have no state and must not move before they are prepared
            again.
    """

    ticks_per_turn: int
    has_watchdog: ClassVar[bool] = True
    torque_constant: float
    baud_rates: tuple[int, ...]
    restarted: set[int]

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
    def prepare(
        self, ids: Iterable[int], mode: Mode, current: float, speed: float
    ) -> None:
        """Set mode and limits of servos, and switch their torque off.

        Args:
            ids: of the servos.
            mode: operating mode.
            current: largest current [A].
            speed: largest speed [rad/s].

        Raises:
            BusError: a servo does not answer, or refuses a value.
        """

    @abstractmethod
    def set_torque(self, ids: Iterable[int], on: bool) -> None:
        """Switch the torque of servos on or off.

        A servo confirms its last goal before it is switched on.

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

        Args:
            goals: position by id [ticks].

        Raises:
            PortLostError: the port is gone.
        """

    @abstractmethod
    def read_states(self, ids: Iterable[int]) -> dict[int, ServoState]:
        """Read the states of servos in one exchange.

        A servo that does not answer in time, whose answer is damaged, or that has
        restarted, is left out; the states of the others are valid.

        Raises:
            PortLostError: the port is gone.
        """

    def read_patiently(
        self, ids: Sequence[int], seconds: float
    ) -> dict[int, ServoState]:
        """Read states; ask servos that do not answer again, at least once.

        Args:
            ids: of the servos.
            seconds: time after which no servo is asked again.

        Returns:
            The states of the servos that answered.

        Raises:
            PortLostError: the port is gone.
        """
        end = time.monotonic() + seconds
        states = self.read_states(ids)
        for attempt in itertools.count():
            missing = [id for id in ids if id not in states]
            if not missing or (attempt and time.monotonic() > end):
                return states
            states |= self.read_states(missing)
        return states

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
