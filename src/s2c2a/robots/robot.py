"""Interface of every robot, and the check of an action."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from datetime import datetime
from typing import ClassVar, Self

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import ActionError
from s2c2a.spaces import Actions, Reading, Sensor

SETTLING_TIME = 1.0
"""Time at rest before the clock starts [s], in which an arm settles under gravity."""


class Robot(ABC):
    """A cable-driven arm, simulated or real, that reads sensors and takes actions.

    The caller sets the pace (`runtime.Loop`). A robot is a context manager: entering
    opens it, leaving closes it, also after an error. The toolbox creates a user's class
    with the arm and the user's options (`--robot my_arm.py:MyArm --robot-option
    port=/dev/ttyUSB0`). If `__init__` has a parameter `seed`, the class receives a seed
    for everything random.

    Attributes:
        arm: description of the arm.
        own_time: whether time passes only in `advance`, as in a simulation; a real
            robot uses wall-clock time.
    """

    arm: ArmSpec
    own_time: ClassVar[bool] = False

    def last_calibration(self) -> datetime | None:
        """When the arm was last homed, or its tracking calibrated; None if unknown."""
        return None

    @property
    @abstractmethod
    def sensors(self) -> Mapping[str, Sensor]:
        """Declared sensors by name; `Reading` lists the names with a fixed meaning."""

    @abstractmethod
    def open(self) -> Reading:
        """Go to rest, settle, start the clock at zero and return the first reading.

        A second call begins a new run; an arm that is bent then goes to rest slowly.
        """

    @abstractmethod
    def read(self) -> Reading:
        """Return the current reading without waiting."""

    @abstractmethod
    def send(self, action: Actions) -> Actions:
        """Set the commanded action and return what was sent, without waiting.

        Args:
            action: displacement [m] or tension [N], shape (modules, cables).

        Raises:
            ActionError: the shape is wrong or a number is not finite; nothing moves.
        """

    def advance(self, seconds: float) -> None:
        """Advance the robot's own time; a real robot returns at once."""
        return None

    def halt(self) -> None:
        """Stop at once where the arm is, after an emergency stop.

        No command follows until the next `open`. By default nothing happens: the arm
        keeps its last command.
        """
        return None

    @abstractmethod
    def close(self) -> None:
        """Leave the arm safe; allowed more than once, and before `open`."""

    def __enter__(self) -> Self:
        try:
            self.open()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_) -> None:
        self.close()


def checked_action(action: Actions, geometry: ArmGeometry) -> Actions:
    """Return the action within the arm's limits, as float64.

    Raises:
        ActionError: the shape is wrong or a number is not finite.
    """
    try:
        values = np.asarray(action, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ActionError(
            f"an action must be an array of numbers, got {action!r}; nothing was sent"
        ) from error
    shape = geometry.action_neutral.shape
    if values.shape != shape:
        raise ActionError(
            f"the action has shape {values.shape}; this arm needs (modules, cables) = "
            f"{shape}; nothing was sent"
        )
    if not np.isfinite(values).all():
        raise ActionError(
            f"the action holds numbers that are not finite: {values.tolist()}; "
            "nothing was sent"
        )
    return np.clip(values, geometry.action_low, geometry.action_high)
