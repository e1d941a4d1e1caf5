"""C2A, the learned configuration controller: how it is built, asked and trained."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data import controller_samples
from s2c2a.models.bilstm import BiLSTM, check_size
from s2c2a.models.scaling import Scaling
from s2c2a.models.sum_and_range import SumAndRange
from s2c2a.spaces import ACTION_HISTORY, CONFIGURATION_HISTORY
from s2c2a.training import FitOptions, Progress, Trained, TrainingData, quiet, train
from s2c2a.training.fit import Batch
from s2c2a.training.trained import with_noise


class History(NamedTuple):
    """What the controller remembers, youngest first.

    Attributes:
        configurations: C_t to C_{t-3} as sensed, shape (*batch, modules, 4, 3).
        actions: A_{t-1} to A_{t-5}, normalised, shape (*batch, modules, 5, cables).
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
        configuration_scaling: of wanted and sensed configurations.
        sum_and_range: the last layer, and the normalisation of actions.
    """

    network: BiLSTM
    configuration_scaling: Scaling
    sum_and_range: SumAndRange

    def for_arm(self, arm: ArmSpec) -> "C2A":
        """The same weights for another arm with as many cables a module; the module count may differ."""
        return replace(self, sum_and_range=SumAndRange.of(arm))

    def __call__(
        self, wanted: Float[Array, "*batch modules 3"], history: History
    ) -> Float[Array, "*batch modules cables"]:
        """Normalised actions, within the arm's limits, that shall lead to the wanted configurations in one step."""
        batch = wanted.shape[:-1]
        parts = [
            self.configuration_scaling.forward(wanted),
            self.configuration_scaling.forward(history.configurations).reshape(*batch, -1),
            history.actions.reshape(*batch, -1),
            jnp.broadcast_to(module_labels(batch[-1])[:, None], (*batch, 1)),
        ]
        raw = self.network(jnp.concatenate(parts, axis=-1))
        return self.sum_and_range.limited(self.sum_and_range(raw))


@dataclass(frozen=True)
class C2AOptions:
    """The biLSTM of C2A: layers, and hidden states of each direction (Chen et al. 2025, table II)."""

    layers: int
    hidden: int

    def __post_init__(self):
        """Refuse what cannot be built."""
        check_size(self)

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> C2A:
        """Random weights and no scaling, for an arm."""
        features = 3 + 3 * CONFIGURATION_HISTORY + arm.cable_count * ACTION_HISTORY + 1
        network = BiLSTM(features, arm.cable_count, self.layers, self.hidden, key)
        return C2A(network, Scaling.identity(3), SumAndRange.of(arm))

    def train(
        self, data: TrainingData, history_noise: float, fit: FitOptions, key: PRNGKeyArray, progress: Progress = quiet
    ) -> Trained[C2A]:
        """Train on what led from one sensed configuration to the next.

        Args:
            data: to learn from.
            history_noise: standard deviation of the noise on past actions in training, normalised (`with_noise`).
            fit: how to train.
            key: for weights, order and noise.
            progress: told epoch, most epochs, validation loss.

        Raises:
            TrainingError: too few samples, or the loss is not finite.
        """
        network_key, fit_key = jax.random.split(key)
        split = controller_samples(data.sensed, data.actions, ArmGeometry.of(data.arm).action_neutral)
        scaling = Scaling.of(split.training.inputs["wanted"])
        model = replace(self.untrained(data.arm, network_key), configuration_scaling=scaling)
        scaled = model.sum_and_range.scaled(split, ages=-2)

        def loss(model: C2A, batch: Batch, key: PRNGKeyArray | None) -> Array:
            return jnp.mean((_answer(model, with_noise(batch, history_noise, key)) - batch["targets"]) ** 2)

        return train(model, loss, _answer, scaled, fit, fit_key, progress)


def _answer(model: C2A, batch: Batch) -> Array:
    return model(batch["wanted"], History(batch["configurations"], batch["actions"]))
