"""What a planner needs to know of an arm: which states follow from a configuration."""

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.kinematics.chain import states_from_configurations

Memory = Any  # a pytree of arrays; () for a model that remembers nothing


class ForwardModel(eqx.Module):
    """A differentiable map from configurations to states that may remember what the sensors said."""

    @abstractmethod
    def start(self, sensed: Float[Array, "modules 3"]) -> Memory:
        """Memory at rest, given the first sensed configuration."""

    @abstractmethod
    def observe(self, sensed: Float[Array, "modules 3"], memory: Memory) -> Memory:
        """Memory after one more sensed configuration."""

    @abstractmethod
    def predict(self, configurations: Float[Array, "*batch modules 3"], memory: Memory) -> Array:
        """States [m, 1], shape (*batch, modules, 6), base frame."""

    @abstractmethod
    def for_planning(self) -> "ForwardModel":
        """The same predictions, with slopes that lead a planner where the true ones are zero or jump."""


class MemorylessModel(ForwardModel):
    """A forward model whose memory is empty, as in the paper."""

    def start(self, sensed: Float[Array, "modules 3"]) -> Memory:
        """Nothing to remember."""
        return ()

    def observe(self, sensed: Float[Array, "modules 3"], memory: Memory) -> Memory:
        """Nothing to remember."""
        return memory

    def for_planning(self) -> "MemorylessModel":
        """The model itself: without memory, slopes lead everywhere."""
        return self


class PCCForwardModel(MemorylessModel):
    """The arm as constant-curvature arcs.

    Attributes:
        lengths: module lengths [m], shape (modules,).
    """

    lengths: Float[Array, " modules"]

    @classmethod
    def of(cls, arm: ArmSpec) -> "PCCForwardModel":
        """The model with the arm's nominal lengths."""
        return cls(jnp.asarray(ArmGeometry.of(arm).lengths, dtype=jnp.float32))

    def predict(self, configurations: Float[Array, "*batch modules 3"], memory: Memory) -> Array:
        """States [m, 1], shape (*batch, modules, 6), base frame."""
        return states_from_configurations(configurations, self.lengths)
