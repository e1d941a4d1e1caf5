"""Networks for actions: the C2A controller, and the LSTM of the paper's comparison.

The LSTM maps a sequence of tip positions over time directly to actions.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.components import Ranges
from s2c2a.data.windows import Split, controller_samples, lstm_samples
from s2c2a.models.layers import LSTM, Scaling, Size, SumAndRange
from s2c2a.paper import BiLSTM, History, controller_inputs
from s2c2a.spaces import ACTION_HISTORY, CONFIGURATION_HISTORY
from s2c2a.training.fit import Batch, FitOptions, Progress, quiet
from s2c2a.training.trained import Trained, TrainingData, train

Actions = Float[Array, "*batch modules cables"]


class C2A(eqx.Module):
    """NN_C2A of the paper (Chen et al. 2025, eq. (8), fig. 5B), with its scaling.

    Attributes:
        network: the biLSTM NN_C2A'.
        configuration_scaling: of desired and sensed configurations.
        sum_and_range: the last layer, and the normalization of actions.
    """

    network: BiLSTM
    configuration_scaling: Scaling
    sum_and_range: SumAndRange

    @classmethod
    def untrained(cls, size: Size, arm: ArmSpec, key: PRNGKeyArray) -> "C2A":
        """Random weights and no scaling, for an arm."""
        features = 3 + 3 * CONFIGURATION_HISTORY + arm.cable_count * ACTION_HISTORY + 1
        network = BiLSTM(features, arm.cable_count, size.layers, size.hidden, key)
        return cls(network, Scaling.identity(3), SumAndRange.of(arm))

    def for_arm(self, arm: ArmSpec) -> "C2A":
        """The same weights for another arm with as many cables in each module.

        The module count may differ.
        """
        return replace(self, sum_and_range=SumAndRange.of(arm))

    def __call__(
        self, desired: Float[Array, "*batch modules 3"], history: History
    ) -> Actions:
        """Normalized actions that reach the desired configurations in one step.

        They are within the limits of the arm.
        """
        inputs = controller_inputs(self.configuration_scaling, desired, history)
        raw = self.network(inputs)
        return self.sum_and_range.limited(self.sum_and_range(raw))


def train_c2a(
    model: C2A,
    data: TrainingData,
    history_noise: float,
    fit: FitOptions,
    key: PRNGKeyArray,
    progress: Progress = quiet,
) -> Trained[C2A]:
    """Train on pairs of successive sensed configurations.

    Args:
        model: with random weights; its configurations are scaled to the data.
        data: recorded episodes.
        history_noise: standard deviation of noise on past actions, normalized.
        fit: options of the training.
        key: for order and noise.
        progress: called with epoch, number of epochs, validation loss.

    Raises:
        TrainingError: too few samples, or the loss is not finite.
    """
    neutral = ArmGeometry.of(data.arm).action_neutral
    split = controller_samples(data.sensed, data.actions, neutral, data.lengths)
    scaling = Scaling.of(split.training.inputs["desired"])
    scaled = replace(model, configuration_scaling=scaling)
    return _train(scaled, _predict_c2a, split, -2, history_noise, fit, key, progress)


def _predict_c2a(model: C2A, batch: Batch) -> Array:
    return model(batch["desired"], History(batch["configurations"], batch["actions"]))


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
        actions: Float[np.ndarray, "episodes samples modules cables"],
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained[TipLSTM]:
        """Train on pairs of successive tip positions.

        Args:
            arm: of the recording.
            tips: true tip positions [m], base frame.
            actions: as sent [m or N].
            key: for weights, order and noise.
            progress: called with epoch, number of epochs, validation loss.

        Raises:
            TrainingError: too few samples, or the loss is not finite.
        """
        network_key, fit_key = jax.random.split(key)
        split = lstm_samples(tips, actions, ArmGeometry.of(arm).action_neutral)
        scaling = Scaling.of(split.training.inputs["desired"])
        model = replace(self.untrained(arm, network_key), position_scaling=scaling)
        return _train(
            model,
            _predict_lstm,
            split,
            1,
            self.history_noise,
            self.fit,
            fit_key,
            progress,
        )


def _predict_lstm(model: TipLSTM, batch: Batch) -> Array:
    return model(batch["desired"], TipHistory(batch["positions"], batch["actions"]))


Network = TypeVar("Network", C2A, TipLSTM)


class _NoisyLoss(eqx.Module):
    """Mean squared error of actions, with noise on past ones in training.

    A module, so that trainings of equal shapes share a compiled program.

    Attributes:
        predict: (network, batch) -> normalized actions.
        std: standard deviation of the noise, normalized.
    """

    predict: Callable[[Any, Batch], Array]
    std: float

    def __call__(
        self, model: C2A | TipLSTM, batch: Batch, key: PRNGKeyArray | None
    ) -> Float[Array, ""]:
        actions = self.predict(model, _with_noise(batch, self.std, key))
        return jnp.mean((actions - batch["targets"]) ** 2)


def _train(
    model: Network,
    predict: Callable[[Network, Batch], Array],
    split: Split,
    ages: int,
    noise: float,
    fit,
    key,
    progress,
) -> Trained[Network]:
    """Train on recorded actions; past ones, with time axis `ages`, get noise."""
    scaled = model.sum_and_range.scaled(split, ages)
    loss = _NoisyLoss(predict, noise)
    return train(model, loss, predict, scaled, fit, key, progress)


def _with_noise(batch: Batch, std: float, key: PRNGKeyArray | None) -> Batch:
    """The batch with noise on its past actions in training.

    Without noise the network learns to repeat its past actions, and diverges in closed
    loop (docs/concepts/deviations.md).
    """
    if key is None:
        return batch
    actions = batch["actions"]
    noise = std * jax.random.normal(key, actions.shape)
    return batch | {"actions": actions + noise}
