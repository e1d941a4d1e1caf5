"""Options of learned controllers (C2A), by name."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import Any

import jax
from jaxtyping import PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.control.controllers import Controller, NetworkController
from s2c2a.data import controller_samples
from s2c2a.models.actions import C2A, NoisyLoss, predict_actions
from s2c2a.models.layers import Scaling, Size, SumAndRange
from s2c2a.paper import C2A_SIZE, BiLSTM
from s2c2a.plugins.components import Options, Registry
from s2c2a.spaces import ACTION_HISTORY, CONFIGURATION_HISTORY
from s2c2a.training import (
    FitOptions,
    Trained,
    TrainingData,
    TrainingProgress,
    quiet,
    train,
)


@dataclass(frozen=True)
class ControllerOptions(Options, ABC):
    """Options of a learned controller; they build and train it.

    A recipe names the class and sets its fields: `[c2a]`,
    `model = "my_controller.py:MyOptions"`, and one line for each field
    (docs/guides/extending.md).

    Attributes:
        model: name of this class in recipes.
    """

    model: str = field(default="", kw_only=True)

    @abstractmethod
    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> Any:
        """The network before training, a pytree.

        Weights are loaded from files into it: options and arm alone determine the
        shapes of its arrays.
        """

    @abstractmethod
    def train(
        self,
        data: TrainingData,
        history_noise: float,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained:
        """Train the network.

        Args:
            data: recorded configurations and actions.
            history_noise: standard deviation of noise on past actions, normalized.
            fit: options of the training.
            key: random key.
            progress: callback with the epoch, the largest number of epochs, and the
                validation loss.

        Raises:
            TrainingError: there are too few samples, or the loss is not finite.
        """

    @abstractmethod
    def controller(self, network: Any) -> Controller:
        """The controller that uses a trained network."""


@dataclass(frozen=True)
class C2AOptions(Size, ControllerOptions):
    """The paper's C2A: a biLSTM along the modules (Chen et al. 2025, eq. (8))."""

    layers: int = C2A_SIZE["layers"]
    hidden: int = C2A_SIZE["hidden"]

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> C2A:
        """See `ControllerOptions`: random weights and no scaling."""
        history = 3 * CONFIGURATION_HISTORY + arm.cable_count * ACTION_HISTORY
        network = BiLSTM(
            3 + history + 1, arm.cable_count, self.layers, self.hidden, key
        )
        return C2A(network, Scaling.identity(3), SumAndRange.of(arm))

    def train(
        self,
        data: TrainingData,
        history_noise: float,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[C2A]:
        """See `ControllerOptions`: on pairs of successive sensed configurations."""
        network_key, fit_key = jax.random.split(key)
        neutral = ArmGeometry.of(data.arm).action_neutral
        split = controller_samples(data.sensed, data.actions, neutral, data.lengths)
        model = replace(
            self.untrained(data.arm, network_key),
            configuration_scaling=Scaling.of(split.training.inputs["desired"]),
        )
        scaled = model.sum_and_range.scaled(split, ages=-2)
        loss = NoisyLoss(predict_actions, history_noise)
        return train(model, loss, predict_actions, scaled, fit, fit_key, progress)

    def controller(self, network: C2A) -> NetworkController:
        return NetworkController(network)


CONTROLLERS: Registry[ControllerOptions] = Registry(
    "controller", ControllerOptions, {"bilstm": C2AOptions}
)
"""Learned controllers by name, for `[c2a] model` in a recipe."""
