"""Emergency stop: any part of a program can stop the arm within one control step.

A push button on a GPIO pin, or one of a joystick, needs two lines:

    from s2c2a.runtime import EMERGENCY_STOP
    button.when_pressed = EMERGENCY_STOP.trigger
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from s2c2a.errors import S2C2AError


class EmergencyStopError(S2C2AError):
    """The emergency stop was triggered; the arm holds its place or is released."""


class EmergencyStop:
    """A switch that stays on until it is reset; safe from any thread or signal."""

    def __init__(self) -> None:
        """A switch that is off."""
        # no lock: a signal handler may interrupt its own thread anywhere
        self._source: str | None = None

    @property
    def is_triggered(self) -> bool:
        """Whether the arm must not move."""
        return self._source is not None

    def trigger(self, source: Any = "a program") -> None:
        """Stop the arm in its next control step.

        Args:
            source: person or device that stopped the arm, for the message.
        """
        self._source = str(source)

    def reset(self) -> None:
        """Allow motion again, from the next opening of the robot on."""
        self._source = None

    def check(self) -> None:
        """Raise an error if the arm must not move.

        Raises:
            EmergencyStopError: the stop was triggered.
        """
        if self.is_triggered:
            text = f"emergency stop by {self._source}; free the arm, then start again"
            raise EmergencyStopError(text)


EMERGENCY_STOP = EmergencyStop()
"""Emergency stop of this process; control loops and opening robots obey it."""


@contextmanager
def stop_on_signal(stop: EmergencyStop = EMERGENCY_STOP) -> Iterator[None]:
    """Trigger an emergency stop at SIGUSR1 (`kill -USR1 PID`), in the main thread."""
    number = getattr(signal, "SIGUSR1", None)
    in_main_thread = threading.current_thread() is threading.main_thread()
    if number is None or not in_main_thread:
        yield
        return
    before = signal.signal(number, lambda *_: stop.trigger("the signal SIGUSR1"))
    try:
        yield
    finally:
        signal.signal(number, before)
