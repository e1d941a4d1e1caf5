"""The search space of a tuning: places in a recipe or strategy, and ranges to try there."""

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from s2c2a.plugins.options import options_from
from s2c2a.strategies import Recipe, strategy_named
from s2c2a.strategies.registry import OPTION

Value = int | float
Values = dict[str, Value]
STRATEGY = "strategy."
"""Begins places among the options of the strategy; others are in the recipe."""


@dataclass(frozen=True)
class Range:
    """A place, and the values to try there.

    Attributes:
        place: such as planner.solver.iterations, planner.terms.Evenness.weight, or
            strategy.gain for an option of the strategy.
        low: the lowest value.
        high: the highest value.
        log: whether the range is sampled logarithmically.
    """

    place: str
    low: float
    high: float
    log: bool

    def drawn(self, current: Value, generator: np.random.Generator) -> Value:
        """A random value of the range; a whole number if the current one is."""
        if self.log:
            exponent = generator.uniform(np.log(self.low), np.log(self.high))
            value = float(np.exp(exponent))
        else:
            value = float(generator.uniform(self.low, self.high))
        return round(value) if isinstance(current, int) else value


def range_from(text: str) -> Range:
    """The range that a text such as `planner.solver.iterations=1:60:log` names."""
    place, _, values = text.partition("=")
    low, high, *scale = values.split(":")
    return Range(place, float(low), float(high), scale == ["log"])


def value_at(recipe: Recipe, place: str, strategy: str) -> Value:
    """The value at a place of a recipe, or of a strategy."""
    value: Any = recipe
    if place.startswith(STRATEGY):
        value = strategy_named(strategy)
    for name in place.removeprefix(STRATEGY).split("."):
        value = _children(value)[name]
    return value


def with_values(recipe: Recipe, values: Values) -> Recipe:
    """The recipe with other values at some places."""
    for place, value in values.items():
        if not place.startswith(STRATEGY):
            recipe = _replaced(recipe, place.split("."), value)
    return recipe


def with_options(strategy: str, values: Values) -> str:
    """The strategy with other values of some options, as `strategy_named` reads it."""
    name, *given = OPTION.split(strategy)
    options: dict[str, Value | str] = dict(options_from(given))
    for place, value in values.items():
        if place.startswith(STRATEGY):
            options[place.removeprefix(STRATEGY)] = value
    settings = [f"{key}={value}" for key, value in options.items()]
    return ",".join([name, *settings])


def _children(value: Any) -> dict[str, Any]:
    """Fields of a dataclass, or items of a tuple by their name."""
    if is_dataclass(value):
        names = [field.name for field in fields(value) if field.init]
        return {name: getattr(value, name) for name in names}
    return {item.name: item for item in value}


def _replaced(holder: Any, path: list[str], value: Value) -> Any:
    if not path:
        return value
    children = _children(holder)
    children[path[0]] = _replaced(children[path[0]], path[1:], value)
    if is_dataclass(holder):
        return replace(holder, **children)  # type: ignore[type-var]
    return tuple(children.values())
