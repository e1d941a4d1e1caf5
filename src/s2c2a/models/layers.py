"""Layers of the networks: scaling, LSTMs, and the output layer for cable actions."""

from dataclasses import dataclass
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.components import Options, Ranges
from s2c2a.data import Samples, Split
from s2c2a.kinematics import bends_from_cables
from s2c2a.training.fit import Fixed, FromArm

MAX_UNROLLED = 8  # modules

HEADROOM = 1.25
"""Normalized actions are in units of the full action times this.

Eq. (10) reaches 0.87 of the full bend in its worst direction, and its tanh reaches one
only at infinity; without headroom some bends in the data would be out of range.
"""


class Scaling(Fixed):
    """Affine map of each feature from `center` +- `half_range` to [-1, 1]."""

    center: Float[Array, " features"]
    half_range: Float[Array, " features"]

    @classmethod
    def of(cls, values: Float[np.ndarray, "*batch features"]) -> "Scaling":
        """The map from the range of the values; a constant feature keeps its unit."""
        flat = values.reshape(-1, values.shape[-1])
        low = flat.min(axis=0)
        high = flat.max(axis=0)
        center = jnp.asarray((low + high) / 2, dtype=jnp.float32)
        half_range = np.where(high > low, (high - low) / 2, 1.0)
        return cls(center, jnp.asarray(half_range, dtype=jnp.float32))

    @classmethod
    def identity(cls, features: int) -> "Scaling":
        """The identity, as a template for files."""
        return cls(jnp.zeros(features), jnp.ones(features))

    def forward(
        self, values: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch features"]:
        """To [-1, 1]."""
        return (values - self.center) / self.half_range

    def back(
        self, values: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch features"]:
        """From [-1, 1]."""
        return values * self.half_range + self.center


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


class Direction(eqx.Module):
    """LSTM layer in one direction; gates are ordered input, forget, cell, output."""

    weight_input: Float[Array, "features gates"]
    weight_hidden: Float[Array, "hidden gates"]
    bias: Float[Array, " gates"]

    def __init__(self, features: int, hidden: int, key: PRNGKeyArray):
        keys = jax.random.split(key, 3)
        gates = 4 * hidden
        self.weight_input = _random_weights(keys[0], hidden, features, gates)
        self.weight_hidden = _random_weights(keys[1], hidden, hidden, gates)
        self.bias = _random_weights(keys[2], hidden, gates)

    def __call__(
        self, inputs: Float[Array, "*batch modules features"], reverse: bool
    ) -> Array:
        """Outputs in the order of the inputs, shape (*batch, modules, hidden).

        The sequence may also be one of time steps instead of modules.
        """
        # computed once, outside of the recurrence
        input_gates = inputs @ self.weight_input + self.bias
        length = inputs.shape[-2]
        if length > MAX_UNROLLED:
            return self._scan(input_gates, reverse)
        outputs = []
        cell = hidden = None
        for step in range(length):
            gates = input_gates[..., length - 1 - step if reverse else step, :]
            if hidden is not None:
                gates = gates + hidden @ self.weight_hidden
            hidden, cell = _cell(gates, cell)
            outputs.append(hidden)
        if reverse:
            outputs.reverse()
        return jnp.stack(outputs, axis=-2)

    def _scan(
        self, input_gates: Float[Array, "*batch modules gates"], reverse: bool
    ) -> Array:
        """The same as one loop: long sequences compile and run far faster."""
        rows = jnp.moveaxis(input_gates, -2, 0)
        zeros = jnp.zeros((*rows.shape[1:-1], self.weight_hidden.shape[0]))

        def step(state: tuple[Array, Array], gates: Array):
            hidden, cell = state
            hidden, cell = _cell(gates + hidden @ self.weight_hidden, cell)
            return (hidden, cell), hidden

        outputs = jax.lax.scan(step, (zeros, zeros), rows, reverse=reverse)[1]
        return jnp.moveaxis(outputs, 0, -2)


def _random_weights(key: PRNGKeyArray, hidden: int, *shape: int) -> Array:
    """Random weights, uniform within 1 / sqrt(hidden)."""
    bound = hidden**-0.5
    return jax.random.uniform(key, shape, minval=-bound, maxval=bound)


def _cell(
    gates: Float[Array, "*batch gates"], cell: Array | None
) -> tuple[Array, Array]:
    """Hidden state and cell state of the next step."""
    input_gate, forget_gate, candidate, output_gate = jnp.split(gates, 4, axis=-1)
    kept = 0.0 if cell is None else jax.nn.sigmoid(forget_gate) * cell
    new_cell = kept + jax.nn.sigmoid(input_gate) * jnp.tanh(candidate)
    return jax.nn.sigmoid(output_gate) * jnp.tanh(new_cell), new_cell


class BiLSTM(eqx.Module):
    """Bidirectional LSTM over modules with a linear head (Chen et al. 2025, fig. 5).

    The number of modules may differ between calls, and any batch axes may lead.

    Example:
        >>> key = jax.random.key(0)
        >>> network = BiLSTM(features=3, outputs=6, layers=4, hidden=64, key=key)
        >>> network(jnp.zeros((3, 3))).shape
        (3, 6)
    """

    layers: list[tuple[Direction, Direction]]
    weight_head: Float[Array, "both_hidden outputs"]
    bias_head: Float[Array, " outputs"]

    def __init__(
        self, features: int, outputs: int, layers: int, hidden: int, key: PRNGKeyArray
    ):
        """Random weights, uniform within 1 / sqrt(hidden).

        Args:
            features: inputs of each module.
            outputs: outputs of each module.
            layers: number of bidirectional layers.
            hidden: hidden states of each direction.
            key: for the weights.
        """
        head_key, *keys = jax.random.split(key, 2 * layers + 1)
        widths = [features] + [2 * hidden] * (layers - 1)
        self.layers = [
            (
                Direction(width, hidden, keys[2 * layer]),
                Direction(width, hidden, keys[2 * layer + 1]),
            )
            for layer, width in enumerate(widths)
        ]
        self.weight_head = _random_weights(head_key, 2 * hidden, 2 * hidden, outputs)
        self.bias_head = jnp.zeros(outputs)

    def __call__(
        self, inputs: Float[Array, "*batch modules features"]
    ) -> Float[Array, "*batch modules outputs"]:
        """Outputs of every module, from the inputs of all modules."""
        values = inputs
        for up, down in self.layers:
            values = jnp.concatenate(
                [up(values, reverse=False), down(values, reverse=True)], axis=-1
            )
        return values @ self.weight_head + self.bias_head


class LSTM(eqx.Module):
    """LSTM over time, oldest step first, with a linear head after the latest step.

    Example:
        >>> key = jax.random.key(0)
        >>> network = LSTM(features=9, outputs=6, layers=2, hidden=64, key=key)
        >>> network(jnp.zeros((5, 9))).shape
        (6,)
    """

    layers: list[Direction]
    weight_head: Float[Array, "hidden outputs"]
    bias_head: Float[Array, " outputs"]

    def __init__(
        self, features: int, outputs: int, layers: int, hidden: int, key: PRNGKeyArray
    ):
        """Random weights, uniform within 1 / sqrt(hidden).

        Args:
            features: inputs of each time step.
            outputs: outputs after the latest time step.
            layers: number of layers.
            hidden: hidden states of each layer.
            key: for the weights.
        """
        head_key, *keys = jax.random.split(key, layers + 1)
        widths = [features] + [hidden] * (layers - 1)
        self.layers = [
            Direction(width, hidden, key)
            for width, key in zip(widths, keys, strict=True)
        ]
        self.weight_head = _random_weights(head_key, hidden, hidden, outputs)
        self.bias_head = jnp.zeros(outputs)

    def __call__(
        self, inputs: Float[Array, "*batch time features"]
    ) -> Float[Array, "*batch outputs"]:
        """Outputs from the whole sequence."""
        values = inputs
        for layer in self.layers:
            values = layer(values, reverse=False)
        return values[..., -1, :] @ self.weight_head + self.bias_head


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
        converted = [jnp.asarray(array, dtype=jnp.float32) for array in arrays]
        matrices, inverses, neutral, unit, low, high = converted
        even = arm.cable_count == 3 and evenly_spaced
        return cls(matrices, inverses, neutral, unit, low, high, even)

    def __call__(
        self, raw: Float[Array, "*batch modules cables"]
    ) -> Float[Array, "*batch modules cables"]:
        """Normalized actions."""
        if self.evenly_three:
            squashed = jnp.tanh(raw)
            return (3.0 * squashed - jnp.sum(squashed, axis=-1, keepdims=True)) / 4.0
        desired = bends_from_cables(self.pseudo_inverses, raw)
        return jnp.einsum("mck,...mk->...mc", self.matrices, _into_unit_disc(desired))

    def normalized(
        self, actions: Float[Array, "*batch modules cables"]
    ) -> Float[Array, "*batch modules cables"]:
        """Actions [m or N] to normalized ones."""
        return (actions - self.neutral) / self.unit

    def actions(
        self, normalized: Float[Array, "*batch modules cables"]
    ) -> Float[Array, "*batch modules cables"]:
        """Normalized actions to [m or N]."""
        return self.neutral + normalized * self.unit

    def limited(
        self, normalized: Float[Array, "*batch modules cables"]
    ) -> Float[Array, "*batch modules cables"]:
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

        return Split(
            normalize(split.training),
            normalize(split.validation),
            normalize(split.test),
        )


def _into_unit_disc(vectors: Float[Array, "*batch 2"]) -> Float[Array, "*batch 2"]:
    """Squash vectors: v tanh(|v|) / |v|, exact at zero."""
    squared = jnp.sum(vectors**2, axis=-1, keepdims=True)
    small = squared < 1e-6
    length = jnp.sqrt(jnp.where(small, 1.0, squared))
    return vectors * jnp.where(small, 1.0 - squared / 3.0, jnp.tanh(length) / length)
