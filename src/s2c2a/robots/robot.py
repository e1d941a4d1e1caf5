"""What every body promises."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import ActionError
from s2c2a.spaces import Actions, Reading, Sensor


class Robot(ABC):
    """An arm that can be driven: read, decide, send, again and again, paced by whoever drives it (`runtime.Loop`).

    Use it as a context manager: entering opens it, leaving closes it, whatever happens
    between. A class of your own is called with the arm and the options that a user
    gives (`--robot my_arm.py:MyArm --robot-option port=/dev/ttyUSB0`); one whose
    `__init__` takes a `seed` is given one, for whatever is random in it.

    Attributes:
        arm: the description that the body follows.
        own_time: whether time passes only in `advance`, as in a simulation; a real body
            takes the wall's.
    """

    arm: ArmSpec
    own_time: ClassVar[bool] = False

    @property
    @abstractmethod
    def sensors(self) -> Mapping[str, Sensor]:
        """What its readings hold, by name: shapes, units and plausible numbers (`Reading` lists the names)."""

    @abstractmethod
    def open(self) -> Reading:
        """Go to rest, settle, start the clock at zero, and say the first reading.

        It may be called again to begin anew; an arm that is bent then goes to rest
        gently, by itself.
        """

    @abstractmethod
    def read(self) -> Reading:
        """What the arm says of itself now; returns at once."""

    @abstractmethod
    def send(self, action: Actions) -> Actions:
        """Ask for an action from now on, and return at once what was really sent.

        Args:
            action: displacement [m] or tension [N], shape (modules, cables).

        Raises:
            ActionError: wrong shape or not finite; nothing has moved.
        """

    def advance(self, seconds: float) -> None:
        """Let the body's own time pass; a real body has none, and returns at once."""
        return None

    @abstractmethod
    def close(self) -> None:
        """Leave the arm safe; can be called twice, and before `open`."""

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
    """The action within the arm's limits, as float64.

    Raises:
        ActionError: wrong shape or not finite.
    """
    try:
        values = np.asarray(action, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ActionError(
            f"an action must be an array of numbers, got {action!r}; nothing was sent"
        ) from error
    if values.shape != geometry.action_neutral.shape:
        raise ActionError(
            f"an action of shape {values.shape} was sent; this arm takes (modules, cables) = "
            f"{geometry.action_neutral.shape}"
        )
    if not np.isfinite(values).all():
        raise ActionError(
            f"the action holds numbers that are not finite: {values.tolist()}; nothing was sent"
        )
    return np.clip(values, geometry.action_low, geometry.action_high)
