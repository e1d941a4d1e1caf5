"""Emergency stop of a real arm from the terminal, or by a signal."""

import os
import select
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from s2c2a.robots.factory import RobotFactory

STOP_KEYS = b" \x1b"  # space bar, Escape
POLL_PERIOD = 0.02  # s; a key acts before the next control step


@contextmanager
def emergency_controls(robot: RobotFactory) -> Iterator[None]:
    """Let SIGUSR1 and, for a real arm, the space bar and Escape stop the arm."""
    from s2c2a.runtime.emergency import EMERGENCY_STOP, stop_on_signal

    EMERGENCY_STOP.reset()
    with stop_on_signal(), nullcontext() if robot.simulated else _stop_on_key():
        yield


@contextmanager
def _stop_on_key() -> Iterator[None]:
    """Watch the keyboard, if the command runs in a terminal."""
    try:
        import termios
        import tty
    except ImportError:  # a system without POSIX terminals
        yield
        return
    if not sys.stdin.isatty():
        yield
        return
    keyboard = sys.stdin.fileno()
    before = termios.tcgetattr(keyboard)
    done = threading.Event()
    watcher = threading.Thread(
        target=_watch_keys, args=(keyboard, done), name="keys", daemon=True
    )
    print("The space bar stops the arm at once.", file=sys.stderr)
    try:
        tty.setcbreak(keyboard)
        watcher.start()
        yield
    finally:
        done.set()
        watcher.join()
        termios.tcsetattr(keyboard, termios.TCSADRAIN, before)


def _watch_keys(keyboard: int, done: threading.Event) -> None:
    from s2c2a.runtime.emergency import EMERGENCY_STOP

    while not done.is_set():
        is_ready, _, _ = select.select([keyboard], [], [], POLL_PERIOD)
        if not is_ready:
            continue
        key = os.read(keyboard, 1)
        if key and key in STOP_KEYS:
            EMERGENCY_STOP.trigger("the keyboard")
