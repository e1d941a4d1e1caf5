"""Recipes: everything that is chosen about networks, training and planning, under one name."""

from dataclasses import asdict, dataclass, field
from typing import Any

from s2c2a.arm import ArmSpec
from s2c2a.data.babbling import SPEEDS
from s2c2a.errors import StrategyError
from s2c2a.networks import ChainSize
from s2c2a.planning import AnyPlannerOptions, LeastSquaresOptions, PlannerOptions
from s2c2a.sensing import DirectionEstimator, Estimator, estimator_for
from s2c2a.training import FitOptions
from s2c2a.training.networks import NetworkSize


@dataclass(frozen=True)
class Recipe:
    """How a strategy is trained and how it plans.

    Attributes:
        name: the word a user types.
        c2s: size of the forward model: the paper's biLSTM, or the chain with memory.
        c2a: size of the controller.
        c2s_fit: how the forward model is trained.
        c2a_fit: how the controller is trained.
        history_noise: on past actions while the controller is trained, normalised.
        planner: how to plan.
        speeds: of the data's motion, as parts of the full bend per step, slowest and fastest.
        correction: part of the controller's lasting error that is integrated in every step; none if zero.
        axis_weights: what mu_o of the protocol's tasks is multiplied by, for names that begin so.
        directions: whether sensed vectors are taken at unit length, whatever mixes them.
    """

    name: str
    c2s: NetworkSize | ChainSize
    c2a: NetworkSize
    c2s_fit: FitOptions = field(default_factory=FitOptions)
    c2a_fit: FitOptions = field(default_factory=FitOptions)
    history_noise: float = 0.05
    planner: AnyPlannerOptions = field(default_factory=PlannerOptions)
    speeds: tuple[float, float] = SPEEDS
    correction: float = 0.0
    axis_weights: tuple[tuple[str, float], ...] = ()
    directions: bool = False

    @property
    def training(self) -> dict[str, Any]:
        """What trained networks depend on: all but how they are put to work."""
        at_work = ("name", "planner", "correction", "axis_weights")
        return {name: value for name, value in asdict(self).items() if name not in at_work}

    def axis_weight(self, task: str) -> float:
        """What mu_o of a task is multiplied by."""
        return next((weight for begin, weight in self.axis_weights if task.startswith(begin)), 1.0)

    def estimator(self, arm: ArmSpec) -> Estimator:
        """What turns the arm's readings into the configurations that this recipe works on."""
        estimator = estimator_for(arm)
        return DirectionEstimator(estimator) if self.directions else estimator


_DECAYING = FitOptions(learning_rate=2e-3, most_epochs=60, patience=60, epochs_per_call=10, decay=True)

RECIPES = {
    "best": Recipe(
        "best",
        c2s=ChainSize(),
        c2a=NetworkSize(layers=2, hidden=32),
        c2s_fit=_DECAYING,
        c2a_fit=_DECAYING,
        planner=LeastSquaresOptions(),
        speeds=(0.02, 0.06),
        correction=0.2,
        axis_weights=(("hold-", 9.0),),
        directions=True,
    ),
    "paper": Recipe("paper", c2s=NetworkSize(layers=4, hidden=64), c2a=NetworkSize(layers=2, hidden=32)),
}
"""What each ingredient of `best` is worth: docs/recipe.md."""


def recipe_named(name: str) -> Recipe:
    """Look a recipe up.

    Raises:
        StrategyError: no such recipe.
    """
    if name not in RECIPES:
        raise StrategyError(f"no recipe '{name}'; choose one of {', '.join(RECIPES)}")
    return RECIPES[name]
