"""Ctrl-C is heeded whenever it comes."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

SOON = 0.1  # s


@contextmanager
def interrupts_heeded() -> Iterator[None]:
    """An interrupt that comes while Python clears up after an object, where nothing can be raised, comes once more."""
    before = sys.unraisablehook

    def hear(lost: Any) -> None:
        if lost.exc_type is KeyboardInterrupt:
            threading.Timer(SOON, os.kill, (os.getpid(), signal.SIGINT)).start()
        else:
            before(lost)

    sys.unraisablehook = hear
    try:
        yield
    finally:
        sys.unraisablehook = before
