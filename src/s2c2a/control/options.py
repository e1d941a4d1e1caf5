"""Options of learned controllers (C2A), by name."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

import jax
from jaxtyping import PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.control.controllers import Controller, NetworkController
from s2c2a.models.actions import C2A, train_c2a
from s2c2a.models.layers import Size
from s2c2a.paper import C2A_SIZE
from s2c2a.plugins.components import Options, Registry
from s2c2a.training import FitOptions, Trained, TrainingData, TrainingProgress, quiet


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
        return C2A.untrained(self, arm, key)

    def train(
        self,
        data: TrainingData,
        history_noise: float,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[C2A]:
        network_key, fit_key = jax.random.split(key)
        model = self.untrained(data.arm, network_key)
        return train_c2a(model, data, history_noise, fit, fit_key, progress)

    def controller(self, network: C2A) -> NetworkController:
        return NetworkController(network)


CONTROLLERS: Registry[ControllerOptions] = Registry(
    "controller",
    ControllerOptions,
    {"bilstm": C2AOptions},
)
"""Learned controllers by name, for `[c2a] model` in a recipe."""
