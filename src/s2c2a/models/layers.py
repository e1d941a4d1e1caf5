"""Layers of the networks: scaling, and the output layer for cable actions."""

from dataclasses import dataclass
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a import paper
from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import cables_present, raised
from s2c2a.data import Samples, Split
from s2c2a.kinematics import bends_from_cables
from s2c2a.kinematics.bends import SMALL_SQUARE
from s2c2a.kinematics.pcc import Cables
from s2c2a.models.arrays import Actions, Matrices
from s2c2a.paper import HEADROOM, sum_and_range
from s2c2a.plugins.components import Options, Ranges
from s2c2a.training.fit import Fixed, FromArm


class Scaling(paper.Scaling, Fixed):
    """The scaling of the paper, which training leaves as it is."""

    @classmethod
    def identity(cls, features: int) -> "Scaling":
        """The identity, as a template for files."""
        return cls(jnp.zeros(features), jnp.ones(features))


@dataclass(frozen=True)
class Size(Options):
    """Size of a network (Chen et al. 2025, table II).

    Attributes:
        layers: number of layers.
        hidden: hidden states of each layer and direction.
    """

    layers: int
    hidden: int

    limits: ClassVar[Ranges] = {"layers": (1, 32), "hidden": (1, 4096)}


class SumAndRange(FromArm):
    r"""Actions in [-1, 1] that lie on each module's two bend directions.

    For three cables at 120 deg (Chen et al. 2025, eq. (10)):
    $$ A_i = \tfrac14 \left( 3 \tanh t_i - \textstyle\sum_j \tanh t_j \right) $$
    For any other layout $v = B^+ t$, $A = B v \tanh(|v|) / |v|$.

    Attributes:
        matrices: B of every module, shape (modules, cables, 2).
        pseudo_inverses: of B, shape (modules, 2, cables).
        neutral: action at rest [m or N], shape (modules, cables).
        unit: action [m or N] of a normalized 1, shape (modules, 1).
        low: least action, shape (modules, cables).
        high: largest action, shape (modules, cables).
        balance: see `ArmGeometry`.
        evenly_three: whether eq. (10) applies.
    """

    matrices: Matrices
    pseudo_inverses: Float[Array, "modules 2 cables"]
    neutral: Cables
    unit: Float[Array, "modules 1"]
    low: Cables
    high: Cables
    balance: Cables | None
    evenly_three: bool = eqx.field(static=True)

    @classmethod
    def of(cls, arm: ArmSpec) -> "SumAndRange":
        """The layer for an arm."""
        geometry = ArmGeometry.of(arm)
        centers = geometry.cable_matrices.sum(axis=1)
        evenly_spaced = bool(np.allclose(centers, 0.0, atol=1e-6))
        arrays = (
            geometry.cable_matrices,
            geometry.bend_matrices,
            geometry.action_neutral,
            HEADROOM * geometry.action_scale[:, None],
            geometry.action_low,
            geometry.action_high,
        )
        converted = [jax.device_put(np.asarray(array, np.float32)) for array in arrays]
        matrices, inverses, neutral, unit, low, high = converted
        is_full = bool(cables_present(arm).all())
        even = arm.cable_count == 3 and is_full and evenly_spaced
        balance = None
        if geometry.balance is not None:
            balance = jnp.asarray(geometry.balance, dtype=jnp.float32)
        return cls(matrices, inverses, neutral, unit, low, high, balance, even)

    def __call__(self, raw: Actions) -> Actions:
        """Normalized actions."""
        if self.evenly_three:
            return sum_and_range(raw)
        desired = bends_from_cables(self.pseudo_inverses, raw)
        return jnp.einsum("mck,...mk->...mc", self.matrices, _into_unit_disc(desired))

    def normalized(self, actions: Actions) -> Actions:
        """Actions [m or N] to normalized ones, without what only raises pressures."""
        parts = (actions - self.neutral) / self.unit
        if self.balance is None:
            return parts
        bends = bends_from_cables(self.pseudo_inverses, parts)
        return jnp.einsum("mck,...mk->...mc", self.matrices, bends)

    def actions(self, normalized: Actions) -> Actions:
        """Normalized actions to [m or N]."""
        actions = self.neutral + normalized * self.unit
        return raised(actions, self.low, self.balance)

    def limited(self, normalized: Actions) -> Actions:
        """Normalized actions within the limits of the arm, as they are sent."""
        return self.normalized(jnp.clip(self.actions(normalized), self.low, self.high))

    def scaled(self, split: Split, ages: int) -> Split:
        """Samples with normalized actions, in the targets and in the history.

        Args:
            split: samples with actions [m or N].
            ages: the time axis of past actions.
        """

        def normalize(samples: Samples) -> Samples:
            actions = jnp.asarray(samples.inputs["actions"])
            past = self.normalized(jnp.moveaxis(actions, ages, 0))
            past = jnp.moveaxis(past, 0, ages)
            inputs = samples.inputs | {"actions": np.asarray(past)}
            targets = self.normalized(jnp.asarray(samples.targets))
            return Samples(inputs, np.asarray(targets))

        return Split(*map(normalize, split.parts))


def _into_unit_disc(vectors: Float[Array, "*batch 2"]) -> Float[Array, "*batch 2"]:
    """Squash vectors: v tanh(|v|) / |v|, exact at zero."""
    squared = jnp.sum(vectors**2, axis=-1, keepdims=True)
    small = squared < SMALL_SQUARE
    length = jnp.sqrt(jnp.where(small, 1.0, squared))
    return vectors * jnp.where(small, 1.0 - squared / 3.0, jnp.tanh(length) / length)
