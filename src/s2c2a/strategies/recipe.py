"""Recipes: everything that is chosen about networks, training and planning, under one name."""

from dataclasses import dataclass, field

from s2c2a.errors import StrategyError
from s2c2a.planning import PlannerOptions
from s2c2a.training import FitOptions
from s2c2a.training.networks import NetworkSize


@dataclass(frozen=True)
class Recipe:
    """How a strategy is trained and how it plans.

    Attributes:
        name: the word a user types.
        c2s: size of the forward model.
        c2a: size of the controller.
        c2s_fit: how the forward model is trained.
        c2a_fit: how the controller is trained.
        history_noise: on past actions while the controller is trained, normalised.
        planner: how to plan.
    """

    name: str
    c2s: NetworkSize
    c2a: NetworkSize
    c2s_fit: FitOptions = field(default_factory=FitOptions)
    c2a_fit: FitOptions = field(default_factory=FitOptions)
    history_noise: float = 0.05
    planner: PlannerOptions = field(default_factory=PlannerOptions)


RECIPES = {
    "paper": Recipe("paper", c2s=NetworkSize(layers=4, hidden=64), c2a=NetworkSize(layers=2, hidden=32)),
}


def recipe_named(name: str) -> Recipe:
    """Look a recipe up.

    Raises:
        StrategyError: no such recipe.
    """
    if name not in RECIPES:
        raise StrategyError(f"no recipe '{name}'; choose one of {', '.join(RECIPES)}")
    return RECIPES[name]
