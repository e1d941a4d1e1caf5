"""Options of learned controllers (C2A), by name."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

from jaxtyping import PRNGKeyArray
from pydantic import ConfigDict

from s2c2a.arm import ArmSpec
from s2c2a.control.controllers import Controller, NetworkController
from s2c2a.errors import StrategyError
from s2c2a.models.actions import C2A, C2AOptions
from s2c2a.registry import OptionsRegistry
from s2c2a.training import FitOptions, Progress, Trained, TrainingData, quiet


@dataclass(frozen=True)
class ControllerOptions(ABC):
    """Options of a learned controller; they build and train it.

    A recipe names the class and sets its fields: `[c2a]`,
    `model = "my_controller.py:MyOptions"`, and one line for each field
    (docs/guides/extending.md).

    Attributes:
        model: name of this class in recipes.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

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
        progress: Progress = quiet,
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

    def for_arm(self, network: Any, arm: ArmSpec) -> Any:
        """A trained network for another arm of the same make.

        Raises:
            StrategyError: this kind of controller does not transfer.
        """
        raise StrategyError(
            f"controller '{self.model}' does not transfer to '{arm.name}'; train it "
            "anew"
        )


@dataclass(frozen=True)
class BiLSTMController(ControllerOptions):
    """The paper's C2A: a biLSTM along the modules (Chen et al. 2025, eq. (8)).

    Attributes:
        layers: number of layers.
        hidden: hidden states of each layer and direction.
    """

    layers: int = 2
    hidden: int = 32
    model: str = field(default="bilstm", kw_only=True)

    def __post_init__(self):
        """Check the limits."""
        self._network()

    def _network(self) -> C2AOptions:
        return C2AOptions(self.layers, self.hidden)

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> C2A:
        """See `ControllerOptions`."""
        return self._network().untrained(arm, key)

    def train(
        self,
        data: TrainingData,
        history_noise: float,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained[C2A]:
        """See `ControllerOptions`."""
        return self._network().train(data, history_noise, fit, key, progress)

    def controller(self, network: C2A) -> NetworkController:
        """See `ControllerOptions`."""
        return NetworkController(network)

    def for_arm(self, network: C2A, arm: ArmSpec) -> C2A:
        """See `ControllerOptions`: replaces the scaling of actions."""
        return network.for_arm(arm)


CONTROLLERS = OptionsRegistry(
    "controller",
    ControllerOptions,  # type: ignore[type-abstract]
    {"bilstm": BiLSTMController},
)
"""Learned controllers by name, for `[c2a] model` in a recipe."""
