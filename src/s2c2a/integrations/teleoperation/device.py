"""Interface of a device that moves the target: keyboard, gamepad, or a user's own."""

import math
from dataclasses import dataclass
from enum import StrEnum
from numbers import Real
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np

from s2c2a.errors import RobotError
from s2c2a.live.request import Point, point
from s2c2a.runtime.border import named_errors

AT_REST: Point = (0.0, 0.0, 0.0)
MAX_SHOWN = 80  # letters of a wrong value: a line


class Button(StrEnum):
    """What a button of a device does."""

    RECORD = "record"
    """Starts a demonstration, and stops and saves it."""
    DISCARD = "discard"
    """Ends a demonstration without saving it."""
    REST = "rest"
    """Lets the arm return to rest, where it waits for the next motion."""
    STOP = "stop"
    """Emergency stop: the arm stays where it is."""
    RESUME = "resume"
    """Allows motion again; after an emergency stop, the arm first returns to rest."""
    QUIT = "quit"
    """Ends the command; the arm returns to rest."""


@dataclass(frozen=True)
class DeviceInput:
    """What a device gives at one moment.

    Attributes:
        velocity: of the target [m/s], base frame.
        pressed: buttons pressed since the last call.

    Raises:
        ValueError: the velocity is not three finite numbers, or there is no such button.
    """

    velocity: Point = AT_REST
    pressed: tuple[Button, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "velocity", _velocity(self.velocity))
        object.__setattr__(self, "pressed", _buttons(self.pressed))


def _velocity(given: Any) -> Point:
    numbers = np.array(given, dtype=object)
    is_real = all(isinstance(each, Real) for each in numbers.flat)
    if numbers.shape == (3,) and is_real and all(map(math.isfinite, numbers)):
        return point(numbers)
    raise ValueError(
        f"velocity is {given!r:.{MAX_SHOWN}}; give three finite numbers [m/s], such as "
        "(0.1, 0.0, 0.0)"
    )


def _buttons(given: Any) -> tuple[Button, ...]:
    names = given if isinstance(given, tuple | list) else (None,)
    known = list(Button)
    if all(each in known for each in names):
        return tuple(map(Button, names))
    raise ValueError(
        f"pressed is {given!r:.{MAX_SHOWN}}; give a tuple of buttons: "
        f"{', '.join(f'Button.{each.name}' for each in Button)}"
    )


@runtime_checkable
class TeleoperationDevice(Protocol):
    """A device that moves the target; a context manager that opens and closes it.

    The toolbox creates a user's class with the largest speed of the target [m/s]
    (`--device my_device.py:MyDevice`). A faster target is slowed down to it.

    Attributes:
        help: one line on its keys or buttons.
    """

    help: str

    def __enter__(self) -> Self:
        """Open the device."""

    def __exit__(self, *error: object) -> None:
        """Close the device."""

    def read(self) -> DeviceInput:
        """Return what the device gives now, without waiting.

        Raises:
            S2C2AError: the device is lost; the arm then returns to rest.
        """


def read_input(device: TeleoperationDevice) -> DeviceInput:
    """What a device gives now.

    Raises:
        RobotError: the device, which may be a user's own, fails or gives something else.
        S2C2AError: the device is lost.
    """
    name = f"the device {type(device).__name__}"
    with named_errors(RobotError, name):
        given = device.read()
    if not isinstance(given, DeviceInput):
        raise RobotError(
            f"{name} gives {given!r:.{MAX_SHOWN}}; its `read` must return a DeviceInput, "
            "also at rest: DeviceInput()"
        )
    return given
