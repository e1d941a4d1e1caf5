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
    def start(self, cables: Float[Array, "modules cables"]) -> Memory:
        """Memory at rest, given the first reading of the cables [m or N]."""

    @abstractmethod
    def observe(self, cables: Float[Array, "modules cables"], memory: Memory) -> Memory:
        """Memory after one more reading of the cables [m or N]."""

    @abstractmethod
    def predict(self, configurations: Float[Array, "*batch modules 3"], memory: Memory) -> Array:
        """States [m, 1], shape (*batch, modules, 6), base frame."""


class MemorylessModel(ForwardModel):
    """A forward model whose memory is empty, as in the paper."""

    def start(self, cables: Float[Array, "modules cables"]) -> Memory:
        """Nothing to remember."""
        return ()

    def observe(self, cables: Float[Array, "modules cables"], memory: Memory) -> Memory:
        """Nothing to remember."""
        return memory


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
