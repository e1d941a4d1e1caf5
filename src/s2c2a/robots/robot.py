"""What every body promises."""

from abc import ABC, abstractmethod
from typing import Self

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import ActionError
from s2c2a.spaces import Actions, Reading


class Robot(ABC):
    """An arm that can be driven, one control step at a time.

    Use it as a context manager: entering opens it, leaving closes it, whatever happens between.

    Attributes:
        arm: the description that the body follows.
    """

    arm: ArmSpec

    @abstractmethod
    def open(self) -> Reading:
        """Go to rest, settle for one second, and start the clock at zero."""

    @abstractmethod
    def read(self) -> Reading:
        """What the arm says of itself now."""

    @abstractmethod
    def send(self, action: Actions) -> Actions:
        """Hold an action for one control step and return, when it is over, what was really sent.

        Args:
            action: displacement [m] or tension [N], shape (modules, cables).

        Raises:
            ActionError: wrong shape or not finite; nothing has moved.
        """

    @abstractmethod
    def close(self) -> None:
        """Leave the arm safe; can be called twice."""

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
        raise ActionError(f"an action must be an array of numbers, got {action!r}; nothing was sent") from error
    if values.shape != geometry.action_neutral.shape:
        raise ActionError(
            f"an action of shape {values.shape} was sent; this arm takes (modules, cables) = "
            f"{geometry.action_neutral.shape}"
        )
    if not np.isfinite(values).all():
        raise ActionError(f"the action holds numbers that are not finite: {values.tolist()}; nothing was sent")
    return np.clip(values, geometry.action_low, geometry.action_high)
