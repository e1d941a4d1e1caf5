"""Piecewise constant curvature (PCC) of an arm, and the forward model interface."""

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.kinematics.chain import states_from_configurations


class PCC(eqx.Module):
    r"""PCC map between the actions and the bends of one arm.

    $$
    a = r B b, \qquad b = \frac{1}{r} B^+ a, \qquad
    B_i = -(\cos\beta_i, \sin\beta_i)
    $$

    For three cables at 120 deg this is eqs. (1) and (2) of Chen et al. 2025. On a
    tension arm the moment that holds the bend against the module's stiffness takes the
    place of the displacement: $T = T_0 - B (B^T B)^{-1} \frac{EI}{r L} b$.

    Attributes:
        to_bends: per module, bends from an action less its neutral, shape (modules, 2,
            cables).
        to_actions: per module, the inverse on the cables' plane, shape (modules,
            cables, 2).
        neutral: action at rest, shape (modules, cables).
        low: least action, shape (modules, cables).
        high: largest action, shape (modules, cables).
    """

    to_bends: Float[Array, "modules 2 cables"]
    to_actions: Float[Array, "modules cables 2"]
    neutral: Float[Array, "modules cables"]
    low: Float[Array, "modules cables"]
    high: Float[Array, "modules cables"]

    @classmethod
    def of(cls, arm: ArmSpec) -> "PCC":
        """Build the map from the arm's nominal parameters."""
        geometry = ArmGeometry.of(arm)
        matrices = geometry.cable_matrices
        radii = geometry.cable_radii[:, None, None]
        if arm.actuation == "displacement":
            to_bends = geometry.bend_matrices / radii
            to_actions = matrices * radii
        else:
            stiffness = per_module(arm, "bending_stiffness") / geometry.lengths
            stiffness = jnp.asarray(stiffness)[:, None, None]
            to_bends = -matrices.swapaxes(-1, -2) * radii / stiffness
            to_actions = -geometry.bend_matrices.swapaxes(-1, -2) * stiffness / radii
        return cls(
            to_bends=_float32(to_bends),
            to_actions=_float32(to_actions),
            neutral=_float32(geometry.action_neutral),
            low=_float32(geometry.action_low),
            high=_float32(geometry.action_high),
        )

    def bends(
        self, actions: Float[Array | np.ndarray, "*batch modules cables"]
    ) -> Float[Array, "*batch modules 2"]:
        """Return the bends [rad] that actions [m or N] hold.

        Common motion of evenly spread cables has no influence.
        """
        return jnp.einsum("mkc,...mc->...mk", self.to_bends, actions - self.neutral)

    def actions(
        self, bends: Float[Array, "*batch modules 2"]
    ) -> Float[Array, "*batch modules cables"]:
        """Return the actions [m or N] that hold bends [rad], within the limits."""
        actions = self.neutral + jnp.einsum("mck,...mk->...mc", self.to_actions, bends)
        return jnp.clip(actions, self.low, self.high)


def _float32(values) -> Array:
    return jnp.asarray(values, dtype=jnp.float32)


Memory = Any  # a pytree of arrays; () for a model without memory


class ForwardModel(eqx.Module):
    """A differentiable map from configurations to states that may remember what the sensors said."""

    @abstractmethod
    def start(self, sensed: Float[Array, "modules 3"]) -> Memory:
        """Memory at rest, given the first sensed configuration."""

    @abstractmethod
    def observe(self, sensed: Float[Array, "modules 3"], memory: Memory) -> Memory:
        """Memory after one more sensed configuration."""

    def given(
        self, disturbances: Any, sensed: Float[Array, "modules 3"], memory: Memory
    ) -> Memory:
        """Memory of a model that is told, in every step, what came about since its recording; most take no notice.

        Args:
            disturbances: `models.disturbances.Disturbances`.
            sensed: configurations, now.
            memory: before.
        """
        return memory

    def corrected(self, disturbances: Any, memory: Memory) -> Memory:
        """After `given`, within the same step: memory of a model that is told a little otherwise; goes with `given`."""
        return memory

    @abstractmethod
    def predict(
        self, configurations: Float[Array, "*batch modules 3"], memory: Memory
    ) -> Array:
        """States [m, 1], shape (*batch, modules, 6), base frame."""

    def tensions(
        self, configurations: Float[Array, "*batch modules 3"], memory: Memory
    ) -> Array:
        """Tensions of the cables there [N], shape (*batch, modules, cables); NaN of models that do not know."""
        return jnp.full((*configurations.shape[:-1], 1), jnp.nan)

    def cable_stiffnesses(self) -> Float[np.ndarray, " modules"] | None:
        """By how much tensions rise with the stretch of a cable over its radius [N/rad]; None if it does not know."""
        return None

    @abstractmethod
    def for_planning(self) -> "ForwardModel":
        """The same predictions, with slopes that lead a planner where the true ones are zero or jump."""

    def near(
        self, configurations: Float[Array, "modules 3"], memory: Memory
    ) -> "ForwardModel":
        """What plans within a step of these configurations are judged by; of most models, the model itself.

        It may be cheaper, and where a step is short it leaves out delays: it says where
        the arm arrives.
        """
        return self

    def predictive_std(
        self, configurations: Float[Array, "*batch modules 3"], memory: Memory
    ) -> Array:
        """Distance of ends from where they are said to be that must be expected [m], shape (*batch, modules).

        Zero of models that do not know.
        """
        return jnp.zeros(configurations.shape[:-1])

    def extrapolation(self, configurations: Float[Array, "*batch modules 3"]) -> Array:
        """How much of that is because nothing was learned near there [m], shape (*batch); zero among the data."""
        return jnp.zeros(configurations.shape[:-2])


class MemorylessModel(ForwardModel):
    """Forward model with an empty memory, as in the paper."""

    def start(self, sensed: Float[Array, "modules 3"]) -> Memory:
        """See `ForwardModel`; the memory stays empty."""
        return ()

    def observe(self, sensed: Float[Array, "modules 3"], memory: Memory) -> Memory:
        """See `ForwardModel`; the memory stays empty."""
        return memory

    def for_planning(self) -> "MemorylessModel":
        """Return the model itself: without memory, its gradient needs no substitute."""
        return self


class PCCForwardModel(MemorylessModel):
    """Forward model of an arm whose modules are constant-curvature arcs.

    Attributes:
        lengths: module lengths [m], shape (modules,).
    """

    lengths: Float[Array, " modules"]

    @classmethod
    def of(cls, arm: ArmSpec) -> "PCCForwardModel":
        """Build the model from the arm's nominal lengths."""
        return cls(_float32(ArmGeometry.of(arm).lengths))

    def predict(
        self, configurations: Float[Array, "*batch modules 3"], memory: Memory
    ) -> Array:
        """See `ForwardModel.predict`."""
        return states_from_configurations(configurations, self.lengths)
