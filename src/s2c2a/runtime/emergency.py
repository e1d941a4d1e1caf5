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
    """Somebody stopped the arm; it stays where it is, or is released."""


class EmergencyStop:
    """A switch that stays on until it is reset; safe from any thread or signal."""

    def __init__(self) -> None:
        """A switch that is off."""
        self._event = threading.Event()
        self._source = ""

    def trigger(self, source: Any = "a program") -> None:
        """Stop the arm in its next control step.

        Args:
            source: who stopped it, for the message.
        """
        self._source = str(source)
        self._event.set()

    def reset(self) -> None:
        """Allow motion again, from the next opening of the robot on."""
        self._event.clear()

    @property
    def is_triggered(self) -> bool:
        """Whether the arm must not move."""
        return self._event.is_set()

    def check(self) -> None:
        """Raise an error if the arm must not move.

        Raises:
            EmergencyStopError: the stop was triggered.
        """
        if self.is_triggered:
            raise EmergencyStopError(
                f"emergency stop by {self._source}; free the arm, then start again"
            )


EMERGENCY_STOP = EmergencyStop()
"""Of this process; every control loop obeys it."""


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
