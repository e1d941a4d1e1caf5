"""A bidirectional LSTM whose sequence is the row of modules, from base to tip and back."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.training.limits import check_limits

MOST_UNROLLED = 8  # modules


def check_size(options) -> None:
    """Refuse layers or hidden states that cannot be built.

    Raises:
        TrainingError: too few or too many.
    """
    check_limits(options, layers=(1, 32), hidden=(1, 4096))


class Direction(eqx.Module):
    """One LSTM layer in one direction; gates in the order input, forget, cell, output."""

    weight_input: Float[Array, "features gates"]
    weight_hidden: Float[Array, "hidden gates"]
    bias: Float[Array, " gates"]

    def __init__(self, features: int, hidden: int, key: PRNGKeyArray):
        bound = hidden**-0.5
        keys = jax.random.split(key, 3)
        self.weight_input = jax.random.uniform(keys[0], (features, 4 * hidden), minval=-bound, maxval=bound)
        self.weight_hidden = jax.random.uniform(keys[1], (hidden, 4 * hidden), minval=-bound, maxval=bound)
        self.bias = jax.random.uniform(keys[2], (4 * hidden,), minval=-bound, maxval=bound)

    def __call__(self, inputs: Float[Array, "*batch modules features"], reverse: bool) -> Array:
        """Outputs in the order of the inputs, shape (*batch, modules, hidden); the row may also be one of moments."""
        driven = inputs @ self.weight_input + self.bias  # hoisted out of the recurrence
        if inputs.shape[-2] > MOST_UNROLLED:
            return self._rolled(driven, reverse)
        order = range(inputs.shape[-2])
        outputs = {}
        cell = hidden = None
        for module in reversed(order) if reverse else order:
            gates = driven[..., module, :]
            if hidden is not None:
                gates = gates + hidden @ self.weight_hidden
            hidden, cell = _cell(gates, cell)
            outputs[module] = hidden
        return jnp.stack([outputs[module] for module in order], axis=-2)

    def _rolled(self, driven: Float[Array, "*batch modules gates"], reverse: bool) -> Array:
        """The same for long rows: as one loop they compile, and run, far sooner than one after the other."""
        rows = jnp.moveaxis(driven, -2, 0)
        nothing = jnp.zeros((*rows.shape[1:-1], self.weight_hidden.shape[0]))

        def on(carried: tuple[Array, Array], gates: Array) -> tuple[tuple[Array, Array], Array]:
            hidden, cell = _cell(gates + carried[0] @ self.weight_hidden, carried[1])
            return (hidden, cell), hidden

        outputs = jax.lax.scan(on, (nothing, nothing), rows, reverse=reverse)[1]
        return jnp.moveaxis(outputs, 0, -2)


def _cell(gates: Float[Array, "*batch gates"], cell: Array | None) -> tuple[Array, Array]:
    take, keep, candidate, show = jnp.split(gates, 4, axis=-1)
    kept = 0.0 if cell is None else jax.nn.sigmoid(keep) * cell
    new_cell = kept + jax.nn.sigmoid(take) * jnp.tanh(candidate)
    return jax.nn.sigmoid(show) * jnp.tanh(new_cell), new_cell


class BiLSTM(eqx.Module):
    """Layers of forward and backward LSTMs and a linear head at every module (Chen et al. 2025, fig. 5).

    Any number of modules at run time, any leading axes.

    Example:
        >>> network = BiLSTM(features=3, outputs=6, layers=4, hidden=64, key=jax.random.key(0))
        >>> network(jnp.zeros((3, 3))).shape
        (3, 6)
    """

    layers: list[tuple[Direction, Direction]]
    weight_head: Float[Array, "both_hidden outputs"]
    bias_head: Float[Array, " outputs"]

    def __init__(self, features: int, outputs: int, layers: int, hidden: int, key: PRNGKeyArray):
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
            (Direction(width, hidden, keys[2 * layer]), Direction(width, hidden, keys[2 * layer + 1]))
            for layer, width in enumerate(widths)
        ]
        bound = (2 * hidden) ** -0.5
        self.weight_head = jax.random.uniform(head_key, (2 * hidden, outputs), minval=-bound, maxval=bound)
        self.bias_head = jnp.zeros(outputs)

    def __call__(self, inputs: Float[Array, "*batch modules features"]) -> Float[Array, "*batch modules outputs"]:
        """Outputs of every module, each with the whole row in view."""
        values = inputs
        for up, down in self.layers:
            values = jnp.concatenate([up(values, reverse=False), down(values, reverse=True)], axis=-1)
        return values @ self.weight_head + self.bias_head
