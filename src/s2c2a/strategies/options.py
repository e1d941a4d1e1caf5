"""The interface of strategies that are chosen by name."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from jaxtyping import PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions, Recording
from s2c2a.errors import StrategyError
from s2c2a.estimation import EstimationSettings
from s2c2a.goals import GoalPart, checked_parts
from s2c2a.planning import Guard
from s2c2a.plugins.components import Options
from s2c2a.runtime import Driver
from s2c2a.runtime.driver import StatedDriver
from s2c2a.strategies.recipe import Recipe
from s2c2a.strategies.trained import TrainedNetworks

RECIPE_KEYS = frozenset(key.name for key in fields(Recipe))
NetworkProgress = Callable[[str, int, int, float], None]
"""Called with network, epoch, number of epochs, validation loss."""


@dataclass(frozen=True)
class RunOptions:
    """Options of a run that strategies use.

    Attributes:
        guard: which points are kept out of obstacles.
        estimation: what the user states about disturbances.
    """

    guard: Guard = "tip"
    estimation: EstimationSettings = EstimationSettings()  # noqa: RUF009  # frozen

    def check_supported(self, supported: frozenset[str], name: str) -> None:
        """Check that a strategy supports the options.

        Args:
            supported: names that it supports: "guard" and `EstimationSettings`.
            name: of the strategy, for the message.

        Raises:
            StrategyError: an option without support differs from its default.
        """
        if self.guard != RunOptions.guard and "guard" not in supported:
            raise StrategyError(
                f"{name} does not support --guard {self.guard}; leave it out, or choose "
                "a strategy that keeps the arm out of obstacles"
            )
        self.estimation.check_supported(supported, name)


@dataclass(frozen=True)
class StrategyOptions(Options, ABC):
    """A strategy by name: what it needs, how it is trained, and how it is built.

    Derive a frozen dataclass from it and name it: `--strategy my_strategy.py:Mine`, or
    an entry point of `s2c2a.strategies`. A strategy without training implements `build`
    alone.

    Attributes:
        name: in messages and weight files; rows and figures show the name that the
            command gives.
        supports: which options of a run it supports (`RunOptions.check_supported`).
        recipe_keys: which keys of a recipe it uses; by default all. A recipe for a
            strategy that uses none is refused.
        ignores: which parts of goals it ignores: the control loop warns of goals that
            have them, and a comparison leaves tasks with them out.
    """

    name: ClassVar[str] = ""
    supports: ClassVar[frozenset[str]] = frozenset()
    recipe_keys: ClassVar[frozenset[str]] = RECIPE_KEYS
    ignores: ClassVar[frozenset[GoalPart]] = frozenset()

    def __post_init__(self):
        """Check the limits, and what it states to ignore."""
        super().__post_init__()
        checked_parts(self.ignores, self)

    def recipe(self, recipe: Recipe) -> Recipe:
        """The recipe that it is trained by, given the one that the user chose."""
        return recipe

    def training_arm(self, arm: ArmSpec, recipe: Recipe) -> ArmSpec:
        """The arm as its training sees it: by default as it is."""
        return arm

    def collect_options(self, recipe: Recipe, seed: int) -> CollectOptions | None:
        """The recording that it is trained on; None for a strategy without training."""
        return None

    def training_key(self, recipe: Recipe) -> Any:
        """Everything beside the recording that training depends on.

        Networks are trained anew where its text differs, or the code of the strategy. By
        default it holds all options of the strategy and all that the recipe trains by.
        """
        return repr(self), recipe.training

    def untrained(
        self, arm: ArmSpec, recipe: Recipe, key: PRNGKeyArray
    ) -> dict[str, Any]:
        """Networks before training, pytrees by name; files are read into them."""
        return {}

    def train(
        self,
        recording: Recording,
        recipe: Recipe,
        seed: int,
        progress: NetworkProgress = lambda *_: None,
    ) -> TrainedNetworks:
        """Train on a recording.

        Args:
            recording: of the arm.
            recipe: how to train.
            seed: of everything random.
            progress: called with network, epoch, number of epochs, validation loss.

        Raises:
            RecordingError: the recording lacks what is needed.
            TrainingError: too few samples, or the loss is not finite.
        """
        raise StrategyError(f"strategy '{self.name}' is not trained")

    @abstractmethod
    def build(
        self,
        arm: ArmSpec,
        recipe: Recipe,
        trained: TrainedNetworks | None,
        run: RunOptions,
    ) -> Driver:
        """Build the strategy for an arm.

        Args:
            arm: that it will drive.
            recipe: how to plan.
            trained: what `train` returned; None for a strategy without training.
            run: options of the run.
        """

    def driver(self, *given: Any) -> Driver:
        """See `build`; what is built states what it ignores, for the control loop."""
        driver = self.build(*given)
        if not self.ignores:
            return driver
        return StatedDriver(driver, self.name or type(self).__name__, self.ignores)
