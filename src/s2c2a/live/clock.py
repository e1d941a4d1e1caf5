"""Time for the live loop, so that nothing sleeps outside of it."""

import threading
import time
from abc import ABC, abstractmethod


class Clock(ABC):
    """Tells the time and waits."""

    @abstractmethod
    def now(self) -> float:
        """Seconds since some moment."""

    @abstractmethod
    def wait_until(self, moment: float, woken: threading.Event) -> None:
        """Return at a moment, or at once when woken."""


class WallClock(Clock):
    """The machine's own time."""

    def now(self) -> float:
        """Seconds since some moment."""
        return time.perf_counter()

    def wait_until(self, moment: float, woken: threading.Event) -> None:
        """Return at a moment, or at once when woken."""
        if (left := moment - self.now()) > 0:
            woken.wait(left)
