"""Disturbances of an arm that its training data do not contain."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.kinematics.bends import Scalar
from s2c2a.kinematics.chain import states_from_bends
from s2c2a.models.arrays import Bends, ModuleBends, PerModule

PAYLOAD_ITERATIONS = 3
"""Between the payload's moments and the shape under them, in a control step and at the
start."""


class LoadGains(NamedTuple):
    """How bends change with a payload whose moments depend on the shape.

    A plan that counts on constant moments moves a loaded arm too far: the more an
    upright arm bends, the more its payload bends it.

    Attributes:
        bends: at the present shape [rad], shape (modules, 2).
        matrix: change of all bends for each change under constant moments, shape
            (2 modules, 2 modules).
    """

    bends: ModuleBends
    matrix: Float[Array, "bends bends"]

    def applied(self, bends: Bends) -> Bends:
        """Bends under the moments of their own shape [rad].

        Args:
            bends: under the moments of the present shape [rad].
        """
        changes = bends - self.bends
        flat = changes.reshape(*changes.shape[:-2], -1) @ self.matrix.T
        return self.bends + flat.reshape(changes.shape)


class Disturbances(NamedTuple):
    """A payload at the tip and bend biases of the modules.

    Attributes:
        payload: mass at the tip [kg].
        bend_biases: bends beside those that the model predicts [rad], shape (modules,
            2): homing errors, drift, softer cables, external forces.
        moments: bending moments of the payload over the bending stiffness [rad], at the
            present shape, shape (modules, 2). None until a forward model has computed
            them (`ForwardModel.with_moments`).
        moments_per_kg: change of the moments with the payload [rad/kg], the same shape.
        gains: how shapes other than the present one change the moments
            (`ForwardModel.with_gains`); None for constant moments.
    """

    payload: Scalar
    bend_biases: ModuleBends
    moments: ModuleBends | None = None
    moments_per_kg: ModuleBends | None = None
    gains: LoadGains | None = None

    @classmethod
    def none(cls, modules: int) -> "Disturbances":
        """No disturbance, as in the training data."""
        zeros = jnp.zeros((modules, 2))
        return cls(jnp.zeros(()), zeros, zeros, zeros)

    def with_payload(self, payload: Scalar) -> "Disturbances":
        """Another payload at the same shape: its moments change in proportion."""
        if self.moments is None or self.moments_per_kg is None:
            return self._replace(payload=payload)
        change = (payload - self.payload) * self.moments_per_kg
        return self._replace(payload=payload, moments=self.moments + change)


def moments_of_weights(
    weights: PerModule,
    bends: Bends,
    lengths: Float[Array, "*#batch modules"],
    compliances: PerModule,
    gravity: Float[Array, "3"],
) -> Bends:
    """Bending moments of weights at the modules' ends, over the bending stiffness.

    C_i sum_j w_j dp_j/db_i . g [rad]

    Args:
        weights: w [kg].
        bends: b [rad].
        lengths: of the modules [m].
        compliances: C, length over bending stiffness [rad/(N m)].
        gravity: g [m/s2], base frame.
    """

    def work(bends: Array) -> Array:
        ends = states_from_bends(bends, lengths)[..., :3]
        return jnp.sum((ends @ gravity) * weights)

    return compliances[:, None] * jax.grad(work)(bends)
