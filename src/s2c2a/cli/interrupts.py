"""Handling of Ctrl-C (SIGINT) at any time, without a traceback.

Requests to end (SIGTERM, SIGHUP) are handled in the same way, so that a real arm is led
to rest and closed.
"""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from traceback import walk_stack
from types import FrameType

INTERRUPTED = 130  # exit code: 128 + SIGINT, as shells have it
RETRY_DELAY = 0.1  # s; an import or a finalization has then gone on
REQUESTS_TO_END = ("SIGTERM", "SIGHUP")


def exit_on_interrupt() -> None:
    """Let an interrupt end the process without a message, before the work starts or after it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))


@contextmanager
def interrupts_as_exceptions() -> Iterator[None]:
    """Turn interrupts into KeyboardInterrupt, even where Python would lose them.

    An interrupt during an import, which the module may turn into an error of its own,
    or during the finalization of an object, where Python cannot raise an exception, is
    repeated after `RETRY_DELAY`. If the process ignores interrupts, as a background job
    of a shell does, it keeps ignoring them.
    """
    previous_hook = sys.unraisablehook
    handler = signal.getsignal(signal.SIGINT)
    in_main_thread = threading.current_thread() is threading.main_thread()
    replaces_handler = in_main_thread and callable(handler)

    def on_unraisable(error) -> None:
        if error.exc_type is KeyboardInterrupt:
            _repeat_interrupt()
        else:
            previous_hook(error)

    sys.unraisablehook = on_unraisable
    try:
        if replaces_handler:
            signal.signal(signal.SIGINT, _on_interrupt)
        with _requests_to_end(in_main_thread):
            yield
    finally:
        if replaces_handler:
            signal.signal(signal.SIGINT, handler)
        sys.unraisablehook = previous_hook


@contextmanager
def _requests_to_end(in_main_thread: bool) -> Iterator[None]:
    """Treat requests to end as interrupts, unless the process handles or ignores them."""
    # not every system has all of them
    known = [vars(signal)[name] for name in REQUESTS_TO_END if name in vars(signal)]
    handled = [
        number
        for number in known
        if in_main_thread and signal.getsignal(number) is signal.SIG_DFL
    ]
    for number in handled:
        signal.signal(number, _on_interrupt)
    try:
        yield
    finally:
        for number in handled:
            signal.signal(number, signal.SIG_DFL)


def _on_interrupt(_: int, frame: FrameType | None) -> None:
    for caller, _ in walk_stack(frame):
        if caller.f_code.co_filename.startswith("<frozen importlib"):
            return _repeat_interrupt()
    raise KeyboardInterrupt


def _repeat_interrupt() -> None:
    # on Windows, os.kill ends the process; elsewhere it also wakes a main thread that waits
    send = signal.raise_signal if os.name == "nt" else partial(os.kill, os.getpid())
    threading.Timer(RETRY_DELAY, send, (signal.SIGINT,)).start()
