"""What of a model is learned and what is fixed, said by type: in training and in files."""

from abc import abstractmethod
from typing import Self, TypeVar

import equinox as eqx
import jax

from s2c2a.arm import ArmSpec

Model = TypeVar("Model")


class Fixed(eqx.Module):
    """A part of a model that training does not move, such as a scaling; files keep it."""


class FromArm(Fixed):
    """A part that follows from the arm alone: no file keeps it, so that none can say of an arm what it is not."""

    @classmethod
    @abstractmethod
    def of(cls, arm: ArmSpec) -> Self:
        """The part for an arm."""


def held(model: Model) -> Model:
    """The same model, without gradients of what is fixed."""
    return jax.tree.map(lambda part: jax.lax.stop_gradient(part) if _is_fixed(part) else part, model, is_leaf=_is_fixed)


def _is_fixed(part) -> bool:
    return isinstance(part, Fixed)
