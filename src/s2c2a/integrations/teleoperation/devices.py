"""Devices by name."""

from typing import Any

from s2c2a.errors import RobotError, S2C2AError
from s2c2a.integrations.teleoperation.device import TeleoperationDevice
from s2c2a.integrations.teleoperation.gamepad import Gamepad
from s2c2a.integrations.teleoperation.keyboard import Keyboard
from s2c2a.plugins import resolve, trust_code
from s2c2a.runtime.border import named_errors

DEVICES: dict[str, Any] = {"keyboard": Keyboard, "gamepad": Gamepad}


def device_named(name: str, speed: float) -> TeleoperationDevice:
    """Make a device that is not opened: of the package, of another, or of a user's file.

    Args:
        name: keyboard, gamepad, an entry point of `s2c2a.teleoperation_devices`, or
            module:Class or file.py:Class.
        speed: largest speed of the target [m/s].

    Raises:
        S2C2AError: there is no such class, it fails, or it is no device.
    """
    trust_code(name)
    make = resolve("teleoperation_device", name, DEVICES)
    with named_errors(RobotError, f"the device {name}"):
        device = make(speed)
    if not isinstance(device, TeleoperationDevice):
        raise S2C2AError(
            f"{name} is no device; it needs help, read, __enter__ and __exit__: see "
            "s2c2a.integrations.teleoperation.device.TeleoperationDevice"
        )
    return device
