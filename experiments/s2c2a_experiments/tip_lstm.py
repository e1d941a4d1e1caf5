"""The LSTM of the paper's comparison: a sequence of tip positions directly to actions."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data import Samples, Split
from s2c2a.data.windows import EpisodeActions, Lengths, history_samples
from s2c2a.models.actions import Actions, NoisyLoss
from s2c2a.models.layers import Scaling, Size, SumAndRange
from s2c2a.paper import Direction, random_weights
from s2c2a.plugins.components import Ranges
from s2c2a.spaces import ACTION_HISTORY
from s2c2a.training.fit import Batch, FitOptions, TrainingProgress, quiet
from s2c2a.training.trained import Trained, train


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
        self.weight_head = random_weights(head_key, hidden, hidden, outputs)
        self.bias_head = jnp.zeros(outputs)

    def __call__(
        self, inputs: Float[Array, "*batch time features"]
    ) -> Float[Array, "*batch outputs"]:
        """Outputs from the whole sequence."""
        values = inputs
        for layer in self.layers:
            values = layer(values, reverse=False)
        return values[..., -1, :] @ self.weight_head + self.bias_head


class TipHistory(NamedTuple):
    """Inputs of the LSTM from the past, oldest first.

    Attributes:
        positions: tip positions p_{t-4} to p_t [m], base frame, shape (*batch, 5, 3).
        actions: A_{t-5} to A_{t-1}, normalized, shape (*batch, 5, modules, cables).
    """

    positions: Float[Array, "*batch 5 3"]
    actions: Float[Array, "*batch 5 modules cables"]


class TipLSTM(eqx.Module):
    """LSTM from tip positions to actions (Chen et al. 2025, sec. IV-A2).

    The features of each time step are the tip position, the action before it, and the
    desired tip position.

    Attributes:
        network: the LSTM.
        position_scaling: of desired and past tip positions.
        sum_and_range: the last layer, and the normalization of actions.
    """

    network: LSTM
    position_scaling: Scaling
    sum_and_range: SumAndRange

    def __call__(
        self, desired: Float[Array, "*batch 3"], history: TipHistory
    ) -> Actions:
        """Normalized actions that bring the tip to the desired position in one step.

        They are within the limits of the arm.
        """
        return self.sum_and_range.limited(self.unlimited(desired, history))

    def unlimited(
        self, desired: Float[Array, "*batch 3"], history: TipHistory
    ) -> Actions:
        """The same actions before they are limited."""
        scaling = self.position_scaling
        layer = self.sum_and_range
        positions = history.positions
        target = scaling.forward(desired)[..., None, :]
        features = [
            scaling.forward(positions),
            history.actions.reshape(*positions.shape[:-1], -1),
            jnp.broadcast_to(target, positions.shape),
        ]
        raw = self.network(jnp.concatenate(features, axis=-1))
        # (*batch, modules, cables)
        return layer(raw.reshape(*desired.shape[:-1], *layer.neutral.shape))


@dataclass(frozen=True)
class LSTMOptions(Size):
    """Options of the LSTM and its training.

    The defaults are the best in closed loop on `circle` with `simulated_arm`.

    Attributes:
        layers: of the network.
        hidden: hidden states of each layer.
        fit: options of the training.
        history_noise: standard deviation of noise on past actions, normalized.
    """

    layers: int = 1
    hidden: int = 64
    fit: FitOptions = field(default_factory=FitOptions)
    history_noise: float = 0.2

    limits: ClassVar[Ranges] = {**Size.limits, "history_noise": (0, 1000)}

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> TipLSTM:
        """Random weights and no scaling, for an arm."""
        actions = arm.module_count * arm.cable_count
        network = LSTM(3 + actions + 3, actions, self.layers, self.hidden, key)
        return TipLSTM(network, Scaling.identity(3), SumAndRange.of(arm))

    def train(
        self,
        arm: ArmSpec,
        tips: Float[np.ndarray, "episodes samples 3"],
        actions: EpisodeActions,
        lengths: Sequence[int],
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[TipLSTM]:
        """Train on pairs of successive tip positions.

        Args:
            arm: of the recording.
            tips: true tip positions [m], base frame.
            actions: as sent [m or N].
            lengths: number of samples of each episode; the rest is padding.
            key: for weights, order and noise.
            progress: called with epoch, number of epochs, validation loss.

        Raises:
            TrainingError: too few samples, or the loss is not finite.
        """
        network_key, fit_key = jax.random.split(key)
        neutral = ArmGeometry.of(arm).action_neutral
        split = lstm_samples(tips, actions, neutral, lengths)
        scaling = Scaling.of(split.training.inputs["desired"])
        model = replace(self.untrained(arm, network_key), position_scaling=scaling)
        loss = NoisyLoss(_predict_lstm, self.history_noise)
        scaled = model.sum_and_range.scaled(split, ages=1)
        return train(model, loss, _predict_lstm, scaled, self.fit, fit_key, progress)


def lstm_samples(
    positions: Float[np.ndarray, "episodes samples 3"],
    actions: EpisodeActions,
    neutral: Float[np.ndarray, "modules cables"],
    lengths: Lengths = None,
) -> Split:
    """Samples for the LSTM: p_{t+1}, p_{t-4} to p_t, A_{t-5} to A_{t-1} in, A_t out.

    Source: Chen et al. 2025, sec. IV-A2. The oldest step of a history is first. Borders
    and starts are as in `controller_samples`. Windows with an unknown tip are dropped.

    Args:
        positions: positions of the tip [m], base frame; NaN: unknown.
        actions: actions that were sent [m or N].
        neutral: action at rest [m or N].
        lengths: number of samples of each episode, if they differ; the rest is padding.
    """
    split = history_samples(
        "positions",
        positions,
        actions,
        neutral,
        sensed_ages=range(ACTION_HISTORY - 1, -1, -1),
        action_ages=range(ACTION_HISTORY, 0, -1),
        axis=1,
        lengths=lengths,
    )
    return Split(*map(_known, split.parts))


def _known(samples: Samples) -> Samples:
    """Samples whose positions are known."""
    inputs = samples.inputs
    positions = np.concatenate([inputs["positions"], inputs["desired"][:, None]], 1)
    return samples.rows(np.isfinite(positions).all(axis=(1, 2)))


def _predict_lstm(model: TipLSTM, batch: Batch) -> Array:
    return model(batch["desired"], TipHistory(batch["positions"], batch["actions"]))
