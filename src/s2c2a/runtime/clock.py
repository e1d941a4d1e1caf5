"""Clocks of control loops: the only place where a loop waits."""

import time
from abc import ABC, abstractmethod

from s2c2a.runtime.standstill import time_with_sleep


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
        """See `Clock` and `s2c2a.runtime.standstill`."""
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
