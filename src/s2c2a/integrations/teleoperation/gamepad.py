"""A gamepad as a device, read by SDL through pygame (the extra `gamepad`).

SDL knows the layouts of common gamepads: sticks and buttons mean the same on all.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np
from jaxtyping import Float

from s2c2a.errors import S2C2AError
from s2c2a.integrations.extras import needs_extra
from s2c2a.integrations.teleoperation.device import Button, DeviceInput
from s2c2a.live.request import point

DEAD_ZONE = 0.15  # of a stick's range; worn sticks do not return to their center
FULL = 32_767  # SDL's largest value of an axis
# numbers of SDL's game controller API (SDL_gamecontroller.h)
LEFT_X, LEFT_Y, RIGHT_Y = 0, 1, 3
BUTTONS = {
    0: Button.RECORD,  # A, cross
    1: Button.STOP,  # B, circle
    2: Button.DISCARD,  # X, square
    3: Button.REST,  # Y, triangle
    4: Button.QUIT,  # back, select
    6: Button.RESUME,  # start
}


@dataclass(frozen=True, eq=False)
class PadState:
    """State of a gamepad.

    Attributes:
        sticks: left one to the right and forward, right one forward; -1 to 1.
        down: numbers of the buttons that are down.
    """

    sticks: Float[np.ndarray, "3"]
    down: frozenset[int]


class Pad(Protocol):
    """A gamepad that is open."""

    def poll(self) -> PadState:
        """Return its state.

        Raises:
            S2C2AError: it is no longer connected.
        """

    def quit(self) -> None:
        """Close it."""


class Gamepad:
    """The first gamepad of this computer.

    Attributes:
        help: one line on the sticks and buttons.
    """

    help = (
        "the left stick moves the target in x and y, the right one in z; A starts and "
        "stops a demonstration, X discards it; Y rest, B emergency stop, start resume, "
        "back quit"
    )

    def __init__(self, speed: float, open_pad: "Callable[[], Pad] | None" = None):
        """A gamepad that is not opened.

        Args:
            speed: of the target with a stick at its end [m/s].
            open_pad: opens the gamepad; by default SDL's first.
        """
        self._speed = speed
        self._open = open_pad or SdlPad
        self._pad: Pad | None = None
        self._down: frozenset[int] = frozenset()

    def __enter__(self) -> Self:
        """Open the gamepad.

        Raises:
            S2C2AError: there is none, or the extra is not installed.
        """
        self._pad = self._open()
        return self

    def __exit__(self, *_: object) -> None:
        """Close the gamepad."""
        if self._pad is not None:
            self._pad.quit()
            self._pad = None

    def read(self) -> DeviceInput:
        """See `TeleoperationDevice`."""
        if self._pad is None:
            raise S2C2AError("the gamepad is not open; use it in a with statement")
        state = self._pad.poll()
        pressed = [
            button
            for number, button in BUTTONS.items()
            if number in state.down - self._down
        ]
        self._down = state.down
        velocity = self._speed * beyond_dead_zone(state.sticks)
        return DeviceInput(point(velocity), tuple(pressed))


def beyond_dead_zone(sticks: np.ndarray) -> np.ndarray:
    """Values of axes, zero in the dead zone and continuous at its border."""
    beyond = (np.abs(sticks) - DEAD_ZONE) / (1.0 - DEAD_ZONE)
    return np.sign(sticks) * np.clip(beyond, 0.0, 1.0)


class SdlPad:
    """The first gamepad that SDL knows."""

    def __init__(self) -> None:
        """Open it.

        Raises:
            S2C2AError: there is none, or the extra is not installed.
        """
        # no window is needed, nor its focus
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
        os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        with needs_extra("gamepad", "a gamepad"):
            import pygame  # noqa: PLC0415  # an extra
            from pygame._sdl2 import controller  # noqa: PLC0415  # an extra
        pygame.display.init()
        controller.init()
        known = filter(controller.is_controller, range(controller.get_count()))
        number = next(known, None)
        if number is None:
            raise S2C2AError(
                "no gamepad with a known layout is connected; connect one, or choose "
                "--device keyboard"
            )
        self._pump: Callable[[], Any] = pygame.event.pump
        self._controller = controller.Controller(number)

    def poll(self) -> PadState:
        """See `Pad`."""
        self._pump()
        pad = self._controller
        if not pad.attached():
            raise S2C2AError("the gamepad is no longer connected")
        # SDL counts downward
        axes = (pad.get_axis(LEFT_X), -pad.get_axis(LEFT_Y), -pad.get_axis(RIGHT_Y))
        down = frozenset(number for number in BUTTONS if pad.get_button(number))
        return PadState(np.array(axes) / FULL, down)

    def quit(self) -> None:
        """See `Pad`."""
        self._controller.quit()
