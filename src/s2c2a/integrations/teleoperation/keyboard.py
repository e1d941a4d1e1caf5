"""Keyboard of a terminal as a device.

A terminal reports keys that are pressed and repeated, and none that are released. A key
counts as held for `HOLD` after each report. The target stops between a press and its
first repetition, and `HOLD` after the release.
"""

import os
import select
import sys
import time
from collections.abc import Callable
from typing import Any, Self

import numpy as np

from s2c2a.errors import S2C2AError
from s2c2a.integrations.teleoperation.device import Button, DeviceInput
from s2c2a.live.request import point
from s2c2a.live.steering import AXES

HOLD = 0.15  # s; systems repeat a held key every 30 to 90 ms
MOTIONS = {
    "\x1b[C": "right",
    "\x1b[D": "left",
    "\x1b[A": "forward",
    "\x1b[B": "back",
    "d": "right",
    "a": "left",
    "w": "forward",
    "s": "back",
    "r": "up",
    "f": "down",
}
BUTTONS = {
    "\n": Button.RECORD,
    "\r": Button.RECORD,
    "\x7f": Button.DISCARD,
    "\b": Button.DISCARD,
    "h": Button.REST,
    " ": Button.STOP,
    "c": Button.RESUME,
    "q": Button.QUIT,
}
APPLICATION_MODE = "\x1bO"  # some terminals send arrows so, instead of with "["
WINDOWS_ARROWS = {"H": "\x1b[A", "P": "\x1b[B", "M": "\x1b[C", "K": "\x1b[D"}
WINDOWS_PREFIXES = "\x00\xe0"
SEQUENCE = 3  # characters of an arrow key
MAX_TEXT = 1024  # bytes read at once; a pasted text is not obeyed for longer


def split_keys(text: str) -> list[str]:
    """Split what a terminal sent into keys; arrow keys have three characters."""
    text = text.replace(APPLICATION_MODE, "\x1b[")
    keys = []
    while text:
        length = SEQUENCE if text.startswith("\x1b[") else 1
        keys.append(text[:length].lower() if length == 1 else text[:length])
        text = text[length:]
    return keys


class Keyboard:
    """The keys of this terminal.

    Attributes:
        help: one line on the keys.
    """

    help = (
        "WASD or arrows move the target in x and y, R and F in z; Enter starts and "
        "stops a demonstration, Backspace discards it; H rest, space emergency stop, "
        "C resume, Q quit"
    )

    def __init__(
        self, speed: float, now: Callable[[], float] = time.monotonic, file: int = -1
    ):
        """A keyboard that is not opened.

        Args:
            speed: of the target while a key is held [m/s].
            now: clock [s].
            file: descriptor of the terminal; that of the standard input if negative.
        """
        self._speed = speed
        self._now = now
        self._file = file
        self._held: dict[str, float] = {}
        self._close: Callable[[], Any] = lambda: None
        self._pending: Callable[[], str] = str

    def __enter__(self) -> Self:
        """Read keys at once, without showing them.

        Raises:
            S2C2AError: there is no terminal.
        """
        file = self._file if self._file >= 0 else sys.stdin.fileno()
        if not os.isatty(file):
            raise S2C2AError(
                "the keyboard was chosen, but the input is no terminal; run the command "
                "in a terminal, or choose --device gamepad"
            )
        if sys.platform == "win32":
            self._pending = _windows_keys
        else:
            self._close, self._pending = _open_posix(file)
        return self

    def __exit__(self, *_: object) -> None:
        """Set the terminal back."""
        self._close()

    def read(self) -> DeviceInput:
        """See `TeleoperationDevice`."""
        now = self._now()
        pressed = []
        for key in split_keys(self._pending()):
            if key in MOTIONS:
                self._held[MOTIONS[key]] = now + HOLD
            if key in BUTTONS:
                pressed.append(BUTTONS[key])
        if pressed:
            self._held.clear()
        held = [AXES[name] for name, end in self._held.items() if end > now]
        direction = np.sum([np.zeros(3), *held], axis=0)
        length = max(float(np.linalg.norm(direction)), 1.0)
        return DeviceInput(point(self._speed / length * direction), tuple(pressed))


def _open_posix(file: int) -> tuple[Callable[[], Any], Callable[[], str]]:
    """Functions that close a terminal, and that return what it sent."""
    import termios  # noqa: PLC0415  # not on Windows
    import tty  # noqa: PLC0415  # not on Windows

    before = termios.tcgetattr(file)
    tty.setcbreak(file)

    def close() -> None:
        termios.tcsetattr(file, termios.TCSADRAIN, before)

    def pending() -> str:
        ready, _, _ = select.select([file], [], [], 0.0)
        if not ready:
            return ""
        content = os.read(file, MAX_TEXT)
        if not content:
            raise S2C2AError("the terminal of the keyboard is closed")
        return content.decode("utf-8", "replace")

    return close, pending


def _windows_keys() -> str:
    """What the console of Windows sent, with the arrow keys of other terminals."""
    import msvcrt  # noqa: PLC0415  # only on Windows

    console: Any = msvcrt
    text = ""
    while console.kbhit() and len(text) < MAX_TEXT:
        key = console.getwch()
        if key in WINDOWS_PREFIXES:
            key = WINDOWS_ARROWS.get(console.getwch(), "")
        text += key
    return text
