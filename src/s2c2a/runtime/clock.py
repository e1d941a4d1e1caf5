"""Time for loops, so that nothing sleeps outside of it."""

import time
from abc import ABC, abstractmethod


class Clock(ABC):
    """Tells the time and waits."""

    @abstractmethod
    def now(self) -> float:
        """Seconds since some moment."""

    @abstractmethod
    def wait_until(self, moment: float) -> None:
        """Return at a moment; at once if it has passed."""


class WallClock(Clock):
    """The machine's own time, which bodies of metal share."""

    def now(self) -> float:
        """Seconds since some moment."""
        return time.perf_counter()

    def wait_until(self, moment: float) -> None:
        """Return at a moment; at once if it has passed."""
        if (left := moment - self.now()) > 0:
            time.sleep(left)


class StepClock(Clock):
    """Time that is wherever somebody waits for it: a simulation then goes as fast as it can."""

    def __init__(self) -> None:
        """At zero."""
        self._now = 0.0

    def now(self) -> float:
        """The last moment that was waited for."""
        return self._now

    def wait_until(self, moment: float) -> None:
        """It is that moment now."""
        self._now = max(self._now, moment)
