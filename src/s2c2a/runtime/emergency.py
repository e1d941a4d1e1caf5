"""Emergency stop by a signal of the operating system."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from s2c2a.emergency import EMERGENCY_STOP, EmergencyStop


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
