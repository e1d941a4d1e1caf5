"""Control-C is heeded whenever it comes."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

INTERRUPTED = 130  # exit code
SOON = 0.1  # s
LOST_IN = (ImportError, SystemError, AttributeError)  # what becomes of an interrupt while a module in C is imported


def end_at_interrupts() -> None:
    """While nothing has begun that could be kept, or after the end, an interrupt ends the process without a word."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))


@contextmanager
def interrupts_heeded() -> Iterator[None]:
    """Interrupts become KeyboardInterrupt, also where that would be lost.

    One that comes while Python clears up after an object, where nothing can be raised, comes once more; one that a
    module made an error of its own while it was imported is taken for what it was. Where interrupts are ignored, as in
    what a shell starts in the background, they stay so.
    """
    before, handler, heard = sys.unraisablehook, signal.getsignal(signal.SIGINT), threading.Event()
    swapped = threading.current_thread() is threading.main_thread() and callable(handler)

    def hear(lost: Any) -> None:
        if lost.exc_type is KeyboardInterrupt:
            threading.Timer(SOON, os.kill, (os.getpid(), signal.SIGINT)).start()
        else:
            before(lost)

    def interrupt(*_: Any) -> None:
        heard.set()
        raise KeyboardInterrupt

    sys.unraisablehook = hear
    try:
        if swapped:
            signal.signal(signal.SIGINT, interrupt)
        yield
    except Exception as error:
        if not (heard.is_set() and isinstance(error.__cause__ or error, LOST_IN)):
            raise
        raise KeyboardInterrupt from error
    finally:
        if swapped:
            signal.signal(signal.SIGINT, handler)
        sys.unraisablehook = before
