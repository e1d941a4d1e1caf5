"""The LSTM that the paper compares with: its sequence is time, and it goes from tip positions straight to actions."""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray
from pydantic import ConfigDict

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data.windows import lstm_samples
from s2c2a.models.bilstm import Direction, check_size
from s2c2a.models.scaling import Scaling
from s2c2a.models.sum_and_range import SumAndRange
from s2c2a.training import FitOptions, Progress, Trained, quiet, train
from s2c2a.training.fit import Batch
from s2c2a.training.limits import check_limits
from s2c2a.training.trained import with_noise


class LSTM(eqx.Module):
    """Layers of LSTMs from the oldest moment to the latest, and a linear head after the latest.

    Example:
        >>> network = LSTM(features=9, outputs=6, layers=2, hidden=64, key=jax.random.key(0))
        >>> network(jnp.zeros((5, 9))).shape
        (6,)
    """

    layers: list[Direction]
    weight_head: Float[Array, "hidden outputs"]
    bias_head: Float[Array, " outputs"]

    def __init__(self, features: int, outputs: int, layers: int, hidden: int, key: PRNGKeyArray):
        """Random weights, uniform within 1 / sqrt(hidden).

        Args:
            features: inputs of each moment.
            outputs: outputs after the latest moment.
            layers: number of layers.
            hidden: hidden states of each layer.
            key: for the weights.
        """
        head_key, *keys = jax.random.split(key, layers + 1)
        widths = [features] + [hidden] * (layers - 1)
        self.layers = [Direction(width, hidden, key) for width, key in zip(widths, keys, strict=True)]
        bound = hidden**-0.5
        self.weight_head = jax.random.uniform(head_key, (hidden, outputs), minval=-bound, maxval=bound)
        self.bias_head = jnp.zeros(outputs)

    def __call__(self, inputs: Float[Array, "*batch time features"]) -> Float[Array, "*batch outputs"]:
        """Outputs with the whole past in view."""
        values = inputs
        for layer in self.layers:
            values = layer(values, reverse=False)
        return values[..., -1, :] @ self.weight_head + self.bias_head


class TipHistory(NamedTuple):
    """What the LSTM remembers, oldest first.

    Attributes:
        positions: tip positions p_{t-4} to p_t [m], base frame, shape (*batch, 5, 3).
        actions: A_{t-5} to A_{t-1}, normalised, shape (*batch, 5, modules, cables).
    """

    positions: Float[Array, "*batch 5 3"]
    actions: Float[Array, "*batch 5 modules cables"]


class TipLSTM(eqx.Module):
    """The LSTM of the comparison (Chen et al. 2025, sec. IV-A2), with its scaling: from tip positions to actions.

    Every moment's features are the tip position then, the action taken just before, and the wanted tip position.

    Attributes:
        network: the LSTM.
        position_scaling: of wanted and past tip positions.
        sum_and_range: the last layer, and the normalisation of actions.
    """

    network: LSTM
    position_scaling: Scaling
    sum_and_range: SumAndRange

    def __call__(self, wanted: Float[Array, "*batch 3"], history: TipHistory) -> Float[Array, "*batch modules cables"]:
        """Normalised actions, within the arm's limits, that shall lead the tip to the wanted position in one step."""
        return self.sum_and_range.limited(self.unlimited(wanted, history))

    def unlimited(self, wanted: Float[Array, "*batch 3"], history: TipHistory) -> Float[Array, "*batch modules cables"]:
        """The same on the bend directions, before the arm's limits cut anything off."""
        scaling, layer = self.position_scaling, self.sum_and_range
        moments = history.positions.shape[:-1]
        target = jnp.broadcast_to(scaling.forward(wanted)[..., None, :], history.positions.shape)
        parts = [scaling.forward(history.positions), history.actions.reshape(*moments, -1), target]
        raw = self.network(jnp.concatenate(parts, axis=-1))
        return layer(raw.reshape(*wanted.shape[:-1], *layer.neutral.shape))  # (*batch, modules, cables)


@dataclass(frozen=True)
class LSTMOptions:
    """The LSTM and how it is trained; the defaults are the best in closed loop on the circle with `simulated_arm`.

    Attributes:
        layers: of the network.
        hidden: hidden states of each layer.
        fit: how it is trained.
        history_noise: on past actions in training, normalised.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    layers: int = 1
    hidden: int = 64
    fit: FitOptions = field(default_factory=FitOptions)
    history_noise: float = 0.2

    def __post_init__(self):
        """Refuse what cannot be built or trained."""
        check_size(self)
        check_limits(self, history_noise=(0, 1000))

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> TipLSTM:
        """Random weights and no scaling, for an arm."""
        actions = arm.module_count * arm.cable_count
        network = LSTM(3 + actions + 3, actions, self.layers, self.hidden, key)
        return TipLSTM(network, Scaling.identity(3), SumAndRange.of(arm))

    def train(
        self,
        arm: ArmSpec,
        tips: Float[np.ndarray, "episodes samples 3"],
        actions: Float[np.ndarray, "episodes samples modules cables"],
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained[TipLSTM]:
        """Train on what led from one tip position to the next.

        Args:
            arm: whose cables they are.
            tips: true tip positions [m], base frame.
            actions: as really sent [m or N].
            key: for weights, order and noise.
            progress: told epoch, most epochs, validation loss.

        Raises:
            TrainingError: too few samples, or the loss is not finite.
        """
        network_key, fit_key = jax.random.split(key)
        split = lstm_samples(tips, actions, ArmGeometry.of(arm).action_neutral)
        scaling = Scaling.of(split.training.inputs["wanted"])
        model = replace(self.untrained(arm, network_key), position_scaling=scaling)
        scaled = model.sum_and_range.scaled(split, ages=1)

        def loss(model: TipLSTM, batch: Batch, key: PRNGKeyArray | None) -> Array:
            return jnp.mean((_answer(model, with_noise(batch, self.history_noise, key)) - batch["targets"]) ** 2)

        return train(model, loss, _answer, scaled, self.fit, fit_key, progress)


def _answer(model: TipLSTM, batch: Batch) -> Array:
    return model(batch["wanted"], TipHistory(batch["positions"], batch["actions"]))
