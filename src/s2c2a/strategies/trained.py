"""Trained networks of an arm, from which a strategy is built."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from s2c2a.arm import ArmSpec
from s2c2a.models.forward_model import ForwardModel
from s2c2a.strategies.recipe import Recipe
from s2c2a.training import Trained


@dataclass(frozen=True)
class TrainedNetworks:
    """The networks of one strategy.

    Attributes:
        arm: that they were trained for.
        recipe: how they were trained, and how to plan with them.
        seed: of the training.
        trained: pytrees with their learning curves and errors, by name, such as "C2S"
            and "C2A".
        strategy: name of the strategy.
        strategy_options: numbers of its options class.
    """

    arm: ArmSpec
    recipe: Recipe
    seed: int
    trained: Mapping[str, Trained]
    strategy: str = "s2c2a"
    strategy_options: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Strategy, arm and networks, whose weights are too many to read."""
        names = ", ".join(self.trained)
        return f"<TrainedNetworks of {self.strategy} on {self.arm.name}: {names}>"

    @property
    def networks(self) -> dict[str, Any]:
        """The pytrees alone, by name."""
        return {name: result.network for name, result in self.trained.items()}

    @property
    def is_prior(self) -> bool:
        """Whether the forward model has the spread of its parameters over arms."""
        return "C2S" in self.trained and self.trained["C2S"].spread is not None

    @property
    def c2s(self) -> ForwardModel:
        """The forward model of the strategy `s2c2a`."""
        return self.trained["C2S"].network

    @property
    def c2a(self) -> Any:
        """The controller's network of the strategy `s2c2a`."""
        return self.trained["C2A"].network
