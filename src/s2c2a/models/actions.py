"""Networks that say actions: C2A, the learned configuration controller, and the LSTM that the paper compares with.

The LSTM's sequence is time, and it goes from tip positions straight to actions.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray
from pydantic import ConfigDict

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data.windows import Split, controller_samples, lstm_samples
from s2c2a.models.layers import LSTM, BiLSTM, Scaling, Size, SumAndRange
from s2c2a.spaces import ACTION_HISTORY, CONFIGURATION_HISTORY
from s2c2a.training.fit import Batch, FitOptions, Progress, check_limits, quiet
from s2c2a.training.trained import Trained, TrainingData, train

Actions = Float[Array, "*batch modules cables"]


class History(NamedTuple):
    """What the controller remembers, youngest first.

    Attributes:
        configurations: C_t to C_{t-3} as sensed, shape (*batch, modules, 4, 3).
        actions: A_{t-1} to A_{t-5}, normalized, shape (*batch, modules, 5, cables).
    """

    configurations: Float[Array, "*batch modules 4 3"]
    actions: Float[Array, "*batch modules 5 cables"]


def module_labels(modules: int) -> Float[Array, " modules"]:
    """n_m = 2 (m - 1) / (n_sum - 1) - 1 (Chen et al. 2025, eq. (9)); zero for a single module."""
    return jnp.linspace(-1.0, 1.0, modules) if modules > 1 else jnp.zeros(1)


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

    def for_arm(self, arm: ArmSpec) -> "C2A":
        """The same weights for another arm with as many cables a module; the module count may differ."""
        return replace(self, sum_and_range=SumAndRange.of(arm))

    def __call__(
        self, desired: Float[Array, "*batch modules 3"], history: History
    ) -> Actions:
        """Normalized actions, within the arm's limits, that shall lead to the desired configurations in one step."""
        batch = desired.shape[:-1]
        parts = [
            self.configuration_scaling.forward(desired),
            self.configuration_scaling.forward(history.configurations).reshape(
                *batch, -1
            ),
            history.actions.reshape(*batch, -1),
            jnp.broadcast_to(module_labels(batch[-1])[:, None], (*batch, 1)),
        ]
        raw = self.network(jnp.concatenate(parts, axis=-1))
        return self.sum_and_range.limited(self.sum_and_range(raw))


@dataclass(frozen=True)
class C2AOptions(Size):
    """The biLSTM of C2A."""

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> C2A:
        """Random weights and no scaling, for an arm."""
        features = 3 + 3 * CONFIGURATION_HISTORY + arm.cable_count * ACTION_HISTORY + 1
        network = BiLSTM(features, arm.cable_count, self.layers, self.hidden, key)
        return C2A(network, Scaling.identity(3), SumAndRange.of(arm))

    def train(
        self,
        data: TrainingData,
        history_noise: float,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained[C2A]:
        """Train on what led from one sensed configuration to the next.

        Args:
            data: to learn from.
            history_noise: standard deviation of the noise on past actions in training,
                normalized.
            fit: how to train.
            key: for weights, order and noise.
            progress: called with epoch, number of epochs, validation loss.

        Raises:
            TrainingError: too few samples, or the loss is not finite.
        """
        network_key, fit_key = jax.random.split(key)
        split = controller_samples(
            data.sensed,
            data.actions,
            ArmGeometry.of(data.arm).action_neutral,
            data.lengths,
        )
        scaling = Scaling.of(split.training.inputs["desired"])
        model = replace(
            self.untrained(data.arm, network_key), configuration_scaling=scaling
        )
        return _trained(
            model, _configurations_in, split, -2, history_noise, fit, fit_key, progress
        )


def _configurations_in(model: C2A, batch: Batch) -> Array:
    return model(batch["desired"], History(batch["configurations"], batch["actions"]))


class TipHistory(NamedTuple):
    """What the LSTM remembers, oldest first.

    Attributes:
        positions: tip positions p_{t-4} to p_t [m], base frame, shape (*batch, 5, 3).
        actions: A_{t-5} to A_{t-1}, normalized, shape (*batch, 5, modules, cables).
    """

    positions: Float[Array, "*batch 5 3"]
    actions: Float[Array, "*batch 5 modules cables"]


class TipLSTM(eqx.Module):
    """The LSTM of the comparison (Chen et al. 2025, sec. IV-A2), with its scaling: from tip positions to actions.

    Every moment's features are the tip position then, the action taken just before, and
    the desired tip position.

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
        """Normalized actions, within the arm's limits, that shall lead the tip to the desired position in one step."""
        return self.sum_and_range.limited(self.unlimited(desired, history))

    def unlimited(
        self, desired: Float[Array, "*batch 3"], history: TipHistory
    ) -> Actions:
        """The same on the bend directions, before the arm's limits cut anything off."""
        scaling = self.position_scaling
        layer = self.sum_and_range
        moments = history.positions.shape[:-1]
        target = jnp.broadcast_to(
            scaling.forward(desired)[..., None, :], history.positions.shape
        )
        parts = [
            scaling.forward(history.positions),
            history.actions.reshape(*moments, -1),
            target,
        ]
        raw = self.network(jnp.concatenate(parts, axis=-1))
        # (*batch, modules, cables)
        return layer(raw.reshape(*desired.shape[:-1], *layer.neutral.shape))


@dataclass(frozen=True)
class LSTMOptions(Size):
    """The LSTM and how it is trained; the defaults are the best in closed loop on the circle with `simulated_arm`.

    Attributes:
        layers: of the network.
        hidden: hidden states of each layer.
        fit: how it is trained.
        history_noise: on past actions in training, normalized.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    layers: int = 1
    hidden: int = 64
    fit: FitOptions = field(default_factory=FitOptions)
    history_noise: float = 0.2

    def __post_init__(self):
        """Refuse what cannot be built or trained."""
        super().__post_init__()
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
            progress: called with epoch, number of epochs, validation loss.

        Raises:
            TrainingError: too few samples, or the loss is not finite.
        """
        network_key, fit_key = jax.random.split(key)
        split = lstm_samples(tips, actions, ArmGeometry.of(arm).action_neutral)
        scaling = Scaling.of(split.training.inputs["desired"])
        model = replace(self.untrained(arm, network_key), position_scaling=scaling)
        return _trained(
            model, _tips_in, split, 1, self.history_noise, self.fit, fit_key, progress
        )


def _tips_in(model: TipLSTM, batch: Batch) -> Array:
    return model(batch["desired"], TipHistory(batch["positions"], batch["actions"]))


Learner = TypeVar("Learner", C2A, TipLSTM)


def _trained(
    model: Learner,
    answer: Callable[[Learner, Batch], Array],
    split: Split,
    ages: int,
    noise: float,
    fit,
    key,
    progress,
) -> Trained[Learner]:
    """Trained to say what was done, with noise on its past actions, which grow older along the axis `ages`."""
    scaled = model.sum_and_range.scaled(split, ages)

    def loss(model: Learner, batch: Batch, key: PRNGKeyArray | None) -> Array:
        return jnp.mean(
            (answer(model, _with_noise(batch, noise, key)) - batch["targets"]) ** 2
        )

    return train(model, loss, answer, scaled, fit, key, progress)


def _with_noise(batch: Batch, deviation: float, key: PRNGKeyArray | None) -> Batch:
    """The batch with noise on its past actions; without, when validating.

    A network that sees its own past unspoilt learns to repeat it, and diverges in
    closed loop (docs/deviations.md).
    """
    if key is None:
        return batch
    return batch | {
        "actions": batch["actions"]
        + deviation * jax.random.normal(key, batch["actions"].shape)
    }
