"""Interface of a device that moves the target: keyboard, gamepad, or a user's own."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, Self, runtime_checkable

from s2c2a.live.request import Point

AT_REST: Point = (0.0, 0.0, 0.0)


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
    """

    velocity: Point = AT_REST
    pressed: tuple[Button, ...] = ()


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
