"""Recipes: everything that is chosen about networks, training and planning, under one name."""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from jaxtyping import PRNGKeyArray
from pydantic import ConfigDict

from s2c2a.arm import ArmSpec
from s2c2a.data.babbling import SPEEDS
from s2c2a.errors import StrategyError
from s2c2a.models import C2AOptions, C2SOptions, ChainOptions, ForwardOptions
from s2c2a.models.registry import code_of, name_of
from s2c2a.planning import BEST, PAPER, PlannerOptions
from s2c2a.sensing import DirectionEstimator, Estimator, estimator_for
from s2c2a.training import FitOptions
from s2c2a.training.limits import check_limits


@dataclass(frozen=True)
class Recipe:
    """How a strategy is trained and how it plans.

    Attributes:
        name: the word a user types.
        c2s: the forward model: the paper's biLSTM, the chain with memory, or one of the user's own.
        c2a: the controller.
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
    c2s: ForwardOptions
    c2a: C2AOptions
    c2s_fit: FitOptions = field(default_factory=FitOptions)
    c2a_fit: FitOptions = field(default_factory=FitOptions)
    history_noise: float = 0.05
    planner: PlannerOptions = PAPER
    speeds: tuple[float, float] = SPEEDS
    correction: float = 0.0
    axis_weights: tuple[tuple[str, float], ...] = ()
    directions: bool = False

    __pydantic_config__ = ConfigDict(extra="forbid")

    def __post_init__(self):
        """Refuse numbers that are none, or absurd; a forward model of one's own goes by the name of its class."""
        limits = {"history_noise": (0, 1000), "speeds": (0, 10), "correction": (0, 10)}
        check_limits(self, StrategyError, **limits)
        if not all(0 <= weight <= 1e6 for _, weight in self.axis_weights):
            raise StrategyError(f"axis_weights = {self.axis_weights} was asked for; take weights of 0 to 1e6")
        if wrong := [place for place, number in _numbers("planner", asdict(self.planner)) if not math.isfinite(number)]:
            raise StrategyError(f"recipe '{self.name}' has no finite number at {', '.join(wrong)}; write one there")
        if not self.c2s.model:
            object.__setattr__(self, "c2s", replace(self.c2s, model=name_of(type(self.c2s))))

    @property
    def training(self) -> dict[str, Any]:
        """What trained networks depend on: all but how they are put to work, and the code of a user's own model."""
        at_work = ("name", "planner", "correction", "axis_weights")
        here = {name: value for name, value in asdict(self).items() if name not in at_work}
        return here | {"code": code_of(type(self.c2s))}

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> dict[str, Any]:
        """Both networks before training."""
        return {"C2S": self.c2s.untrained(arm, key), "C2A": self.c2a.untrained(arm, key)}

    def axis_weight(self, task: str) -> float:
        """What mu_o of a task is multiplied by."""
        return next((weight for begin, weight in self.axis_weights if task.startswith(begin)), 1.0)

    def estimator(self, arm: ArmSpec) -> Estimator:
        """What turns the arm's readings into the configurations that this recipe works on."""
        estimator = estimator_for(arm)
        return DirectionEstimator(estimator) if self.directions else estimator


def _numbers(place: str, value: Any) -> Iterator[tuple[str, float]]:
    """Every number within, and where it stands."""
    if isinstance(value, float):
        yield place, value
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list | tuple) else ()
    for name, part in inside:
        yield from _numbers(f"{place}.{name}", part)


_DECAYING = FitOptions(learning_rate=2e-3, most_epochs=60, patience=60, epochs_per_call=10, decay=True)

RECIPES = {
    "best": Recipe(
        "best",
        c2s=ChainOptions(),
        c2a=C2AOptions(layers=2, hidden=32),
        c2s_fit=_DECAYING,
        c2a_fit=_DECAYING,
        planner=BEST,
        speeds=(0.02, 0.06),
        correction=0.2,
        axis_weights=(("hold-", 9.0),),
        directions=True,
    ),
    "paper": Recipe("paper", c2s=C2SOptions(layers=4, hidden=64), c2a=C2AOptions(layers=2, hidden=32)),
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
