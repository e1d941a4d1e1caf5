"""The 'sum and range' layer: whatever the network says becomes actions that an incompressible module can follow."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data import Samples, Split
from s2c2a.training import FromArm

HEADROOM = 1.25
"""Normalised actions are in units of the full action times this.

Eq. (10) reaches 0.87 of the full bend in its worst direction, and its tanh reaches one only at infinity; without room
the network could not say some of the bends that its own data hold.
"""


class SumAndRange(FromArm):
    r"""Actions in [-1, 1] that lie on each module's two bend directions.

    For three cables at 120 deg (Chen et al. 2025, eq. (10)):
    $$ A_i = \tfrac14 \left( 3 \tanh t_i - \textstyle\sum_j \tanh t_j \right) $$
    For any other layout $v = B^+ t$, $A = B v \tanh(|v|) / |v|$.

    Attributes:
        matrices: B of every module, shape (modules, cables, 2).
        pseudo_inverses: of B, shape (modules, 2, cables).
        neutral: action at rest [m or N], shape (modules, cables).
        unit: action [m or N] of a normalised 1, shape (modules, 1).
        low: least action, shape (modules, cables).
        high: largest action, shape (modules, cables).
        evenly_three: whether eq. (10) applies.
    """

    matrices: Float[Array, "modules cables 2"]
    pseudo_inverses: Float[Array, "modules 2 cables"]
    neutral: Float[Array, "modules cables"]
    unit: Float[Array, "modules 1"]
    low: Float[Array, "modules cables"]
    high: Float[Array, "modules cables"]
    evenly_three: bool = eqx.field(static=True)

    @classmethod
    def of(cls, arm: ArmSpec) -> "SumAndRange":
        """The layer for an arm."""
        geometry = ArmGeometry.of(arm)
        arrays = (
            geometry.cable_matrices,
            geometry.bend_matrices,
            geometry.action_neutral,
            HEADROOM * geometry.action_scale[:, None],
            geometry.action_low,
            geometry.action_high,
        )
        even = arm.cable_count == 3 and bool(np.allclose(geometry.cable_matrices.sum(axis=1), 0.0, atol=1e-6))
        matrices, inverses, neutral, unit, low, high = (jnp.asarray(array, dtype=jnp.float32) for array in arrays)
        return cls(matrices, inverses, neutral, unit, low, high, even)

    def __call__(self, raw: Float[Array, "*batch modules cables"]) -> Float[Array, "*batch modules cables"]:
        """Normalised actions."""
        if self.evenly_three:
            squashed = jnp.tanh(raw)
            return (3.0 * squashed - jnp.sum(squashed, axis=-1, keepdims=True)) / 4.0
        wanted = jnp.einsum("mkc,...mc->...mk", self.pseudo_inverses, raw)
        return jnp.einsum("mck,...mk->...mc", self.matrices, _into_unit_disc(wanted))

    def normalised(self, actions: Float[Array, "*batch modules cables"]) -> Float[Array, "*batch modules cables"]:
        """Actions [m or N] to normalised ones."""
        return (actions - self.neutral) / self.unit

    def actions(self, normalised: Float[Array, "*batch modules cables"]) -> Float[Array, "*batch modules cables"]:
        """Normalised actions to [m or N]."""
        return self.neutral + normalised * self.unit

    def limited(self, normalised: Float[Array, "*batch modules cables"]) -> Float[Array, "*batch modules cables"]:
        """Normalised actions within the arm's limits: what will really be sent."""
        return self.normalised(jnp.clip(self.actions(normalised), self.low, self.high))

    def scaled(self, split: Split, ages: int) -> Split:
        """Samples with all actions normalised, those taken and past ones, which grow older along the axis `ages`."""

        def normalised(samples: Samples) -> Samples:
            past = self.normalised(jnp.moveaxis(jnp.asarray(samples.inputs["actions"]), ages, 0))
            inputs = samples.inputs | {"actions": np.asarray(jnp.moveaxis(past, 0, ages))}
            return Samples(inputs, np.asarray(self.normalised(jnp.asarray(samples.targets))))

        return Split(*(normalised(part) for part in (split.training, split.validation, split.test)))


def _into_unit_disc(vectors: Float[Array, "*batch 2"]) -> Float[Array, "*batch 2"]:
    """V tanh(|v|) / |v|, exact at zero."""
    squared = jnp.sum(vectors**2, axis=-1, keepdims=True)
    small = squared < 1e-6
    length = jnp.sqrt(jnp.where(small, 1.0, squared))
    return vectors * jnp.where(small, 1.0 - squared / 3.0, jnp.tanh(length) / length)
