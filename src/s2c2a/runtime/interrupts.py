"""Interrupts are ignored while an arm moves to rest."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

INTERRUPTS = ("SIGINT", "SIGTERM", "SIGHUP")  # not every system has all


@contextmanager
def ignored_interrupts() -> Iterator[None]:
    """Ignore interrupts in the main thread: a second one leaves no arm bent."""
    # only the main thread receives signals
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [getattr(signal, name, None) for name in INTERRUPTS]
    handlers = {
        number: signal.signal(number, signal.SIG_IGN) for number in numbers if number
    }
    try:
        yield
    finally:
        for number, handler in handlers.items():
            # None if the handler was not set from Python
            signal.signal(number, handler or signal.SIG_DFL)
