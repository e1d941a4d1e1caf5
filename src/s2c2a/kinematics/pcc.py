"""Piecewise constant curvature (PCC) of an arm, and the forward model interface."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import per_module, per_unit_of_pull, raised
from s2c2a.kinematics.bends import Numbers, bends_from_cables

Cables = Float[Array, "modules cables"]


class PCC(eqx.Module):
    r"""PCC map between the actions and the bends of one arm.

    $$
    a = r B b, \qquad b = \frac{1}{r} B^+ a, \qquad
    B_i = -(\cos\beta_i, \sin\beta_i)
    $$

    For three cables at 120 deg this is eqs. (1) and (2) of Chen et al. 2025. On a
    tension arm the moment that holds the bend against the module's stiffness takes the
    place of the displacement: $T = T_0 - B (B^T B)^{-1} \frac{EI}{r L} b$. Chambers push,
    with their area times the pressure.

    Attributes:
        to_bends: per module, bends from an action less its neutral, shape (modules, 2,
            cables).
        to_actions: per module, the inverse on the cables' plane, shape (modules,
            cables, 2).
        neutral: action at rest, shape (modules, cables).
        low: least action, shape (modules, cables).
        high: largest action, shape (modules, cables).
        balance: see `ArmGeometry`.
    """

    to_bends: Float[Array, "modules 2 cables"]
    to_actions: Float[Array, "modules cables 2"]
    neutral: Cables
    low: Cables
    high: Cables
    balance: Cables | None

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
            moments = per_unit_of_pull(arm) * geometry.cable_radii / stiffness
            moments = np.asarray(moments)[:, None, None]
            to_bends = -matrices.swapaxes(-1, -2) * moments
            to_actions = -geometry.bend_matrices.swapaxes(-1, -2) / moments
        return cls(
            to_bends=_float32(to_bends),
            to_actions=_float32(to_actions),
            neutral=_float32(geometry.action_neutral),
            low=_float32(geometry.action_low),
            high=_float32(geometry.action_high),
            balance=None if geometry.balance is None else _float32(geometry.balance),
        )

    def bends(
        self, actions: Float[Numbers, "*batch modules cables"]
    ) -> Float[Array, "*batch modules 2"]:
        """Return the bends [rad] that actions [m or N] hold.

        Common motion of evenly spread cables has no influence.
        """
        return bends_from_cables(self.to_bends, actions - self.neutral)

    def actions(
        self, bends: Float[Numbers, "*batch modules 2"]
    ) -> Float[Array, "*batch modules cables"]:
        """Return the actions [m or N] that hold bends [rad], within the limits."""
        actions = self.neutral + jnp.einsum("mck,...mk->...mc", self.to_actions, bends)
        return jnp.clip(raised(actions, self.low, self.balance), self.low, self.high)


def _float32(values) -> Array:
    return jax.device_put(np.asarray(values, np.float32))
