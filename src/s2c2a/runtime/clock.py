"""Clocks of control loops: the only place where a loop waits."""

import time
from abc import ABC, abstractmethod

STANDSTILL = 2.0
"""Time beyond a control period [s] without a command, after which a real arm is held
until somebody asks it to resume: whoever is near it takes it for switched off."""


def time_with_sleep() -> float:
    """Return the time since a fixed origin [s], with that of a suspended computer.

    Without such a clock, a suspended computer shows no gap.
    """
    # `perf_counter` stands still while Linux and macOS are suspended
    number = getattr(time, "CLOCK_BOOTTIME", getattr(time, "CLOCK_MONOTONIC", None))
    return time.perf_counter() if number is None else time.clock_gettime(number)


class Clock(ABC):
    """A source of time that can wait."""

    @abstractmethod
    def now(self) -> float:
        """Return the time since a fixed origin [s]."""

    def with_sleep(self) -> float:
        """Return the time since a fixed origin [s], with that of a suspended computer."""
        return self.now()

    @abstractmethod
    def wait_until(self, moment: float) -> None:
        """Return at a moment; at once if it has passed."""


class WallClock(Clock):
    """The computer's clock, for robots that move in real time."""

    def now(self) -> float:
        return time.perf_counter()

    def with_sleep(self) -> float:
        """See `Clock`."""
        return time_with_sleep()

    def wait_until(self, moment: float) -> None:
        remaining = moment - self.now()
        if remaining > 0:
            time.sleep(remaining)


class StepClock(Clock):
    """A clock that jumps to the awaited moment: a simulation runs at full speed."""

    def __init__(self) -> None:
        """A clock at zero."""
        self._now = 0.0

    def now(self) -> float:
        """Return the last awaited moment [s]."""
        return self._now

    def wait_until(self, moment: float) -> None:
        """Set the time to a moment."""
        self._now = max(self._now, moment)
