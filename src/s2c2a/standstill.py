"""Gaps between the commands of a real arm: a stopped program, a suspended computer."""

import time
from collections.abc import Callable

from s2c2a.errors import RobotError

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


class StandstillCheck:
    """Ends a motion that stood still: whoever started it no longer expects it."""

    def __init__(self, clock: Callable[[], float] | None = None) -> None:
        """The motion begins now.

        Args:
            clock: returns the time [s]; by default `time_with_sleep`.
        """
        self._now = clock or time_with_sleep
        self._last = self._now()

    def check(self) -> None:
        """Check the time since the last call, before a command.

        Raises:
            RobotError: it is longer than `STANDSTILL`.
        """
        now = self._now()
        pause = now - self._last
        if pause > STANDSTILL:
            raise RobotError(
                f"the program stood still for {pause:.1f} s in the middle of a motion, "
                "which ends here; see that nobody touches the arm, then start again"
            )
        self._last = now
