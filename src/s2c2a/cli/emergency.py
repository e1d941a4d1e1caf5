"""Emergency stop of a real arm from the terminal, or by a signal."""

import os
import select
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from s2c2a.robots.factory import RobotFactory

STOP_KEYS = b" \x1b"  # space bar, Escape
RESUME_KEYS = b"rR"
POLL_PERIOD = 0.02  # s; a key acts before the next control step


@contextmanager
def emergency_controls(robot: RobotFactory) -> Iterator[None]:
    """Let SIGUSR1 and, for a real arm, the space bar and Escape stop the arm."""
    from s2c2a.runtime.emergency import EMERGENCY_STOP, stop_on_signal

    EMERGENCY_STOP.reset()
    with stop_on_signal(), nullcontext() if robot.simulated else stop_on_key():
        yield


@contextmanager
def stop_on_key() -> Iterator[None]:
    """Let the space bar and Escape stop the arm, if the command runs in a terminal."""
    try:
        import termios
        import tty
    except ImportError:  # a system without POSIX terminals
        yield
        return
    if not sys.stdin.isatty() or _is_in_background(sys.stdin.fileno()):
        yield
        return
    keyboard = sys.stdin.fileno()
    before = termios.tcgetattr(keyboard)
    done = threading.Event()
    watcher = threading.Thread(
        target=_watch_keys, args=(keyboard, done), name="keys", daemon=True
    )
    print("The space bar or Escape stops the arm at once.", file=sys.stderr)
    watcher.start()
    try:
        tty.setcbreak(keyboard)
        yield
    finally:
        done.set()
        watcher.join()
        termios.tcsetattr(keyboard, termios.TCSADRAIN, before)


def _is_in_background(keyboard: int) -> bool:
    """Whether the terminal suspends this process when it changes the keyboard."""
    try:
        return os.tcgetpgrp(keyboard) != os.getpgrp()
    except OSError:  # not the terminal that controls this process
        return False


def _watch_keys(keyboard: int, done: threading.Event) -> None:
    from s2c2a.runtime.emergency import EMERGENCY_STOP
    from s2c2a.runtime.operator import OPERATOR

    OPERATOR.attends = True
    while not done.is_set():
        is_ready, _, _ = select.select([keyboard], [], [], POLL_PERIOD)
        if not is_ready:
            continue
        key = os.read(keyboard, 1)
        if not key:  # the terminal is closed
            break
        if key in STOP_KEYS:
            EMERGENCY_STOP.trigger("the keyboard")
        if key in RESUME_KEYS:
            OPERATOR.agrees = True
    OPERATOR.attends = False
