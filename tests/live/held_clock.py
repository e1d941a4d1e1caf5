"""A clock of a control thread that a test advances: no real time passes."""

import threading

from s2c2a.runtime import Clock

PATIENCE = 300.0  # s of real time; a step that takes longer hangs


class HeldClock(Clock):
    """Lets a thread go on as far as a test has advanced the time.

    A test and the thread never run at once, so that what the test asks for comes into
    effect in the next step.
    """

    def __init__(self):
        self._changed = threading.Condition()
        self._now = 0.0
        self._awaited = 0.0
        self._allowed = 0.0

    def now(self) -> float:
        """See `Clock`."""
        return self._now

    def wait_until(self, moment: float) -> None:
        """See `Clock`; waits for the test to advance the time."""
        with self._changed:
            self._awaited = moment
            self._changed.notify_all()
            self._changed.wait_for(lambda: moment <= self._allowed)
            self._now = max(self._now, moment)

    def advance(self, seconds: float) -> None:
        """Let the thread run for a time; returns when it waits again."""
        with self._changed:
            self._allowed += seconds
            self._changed.notify_all()
            waits = self._changed.wait_for(
                lambda: self._awaited > self._allowed, PATIENCE
            )
        assert waits, f"the thread did not come to {self._allowed:g} s"

    def until(self, condition, seconds=30.0, what="the condition", period=0.1) -> None:
        """Advance, period by period, until a condition is true."""
        for _ in range(round(seconds / period)):
            if condition():
                return
            self.advance(period)
        assert condition(), f"{what} was not met within {seconds:g} s"

    def release(self) -> None:
        """Let the thread run freely."""
        with self._changed:
            self._allowed = float("inf")
            self._changed.notify_all()
