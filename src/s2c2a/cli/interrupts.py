"""Control-C is heeded whenever it comes."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from traceback import walk_stack
from types import FrameType

INTERRUPTED = 130  # exit code
SOON = 0.1  # s


def end_at_interrupts() -> None:
    """While nothing has begun that could be kept, or after the end, an interrupt ends the process without a word."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))


@contextmanager
def interrupts_heeded() -> Iterator[None]:
    """Interrupts become KeyboardInterrupt, also where that would be lost.

    One that comes while a module is imported, which may make an error of its own of it,
    or while Python clears up after an object, where nothing can be raised, comes once
    more. Where interrupts are ignored, as in what a shell starts in the background,
    they stay so.
    """
    before = sys.unraisablehook
    handler = signal.getsignal(signal.SIGINT)
    swapped = threading.current_thread() is threading.main_thread() and callable(
        handler
    )
    sys.unraisablehook = lambda lost: (
        _come_again() if lost.exc_type is KeyboardInterrupt else before(lost)
    )
    try:
        if swapped:
            signal.signal(signal.SIGINT, _interrupt)
        yield
    finally:
        if swapped:
            signal.signal(signal.SIGINT, handler)
        sys.unraisablehook = before


def _interrupt(_: int, frame: FrameType | None) -> None:
    if any(
        one.f_code.co_filename.startswith("<frozen importlib")
        for one, _ in walk_stack(frame)
    ):
        return _come_again()
    raise KeyboardInterrupt


def _come_again() -> None:
    threading.Timer(SOON, os.kill, (os.getpid(), signal.SIGINT)).start()
