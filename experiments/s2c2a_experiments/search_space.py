"""The search space of a sweep: places in a recipe or strategy, and values to try there."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from s2c2a.errors import S2C2AError, did_you_mean
from s2c2a.plugins.options import options_from
from s2c2a.strategies import Recipe, strategy_named
from s2c2a.strategies.registry import OPTION

Value = bool | int | float
SAMPLE = (
    "planner.solver.iterations=5:60, c2s_fit.learning_rate=1e-4:1e-2:log "
    "or c2s.hidden=32,64,128"
)
NOT_VARIED = (
    "name",  # no option
    "planner.guard",  # belongs to the task
    "c2s.model",  # would make another recipe
)
STRATEGY = "strategy."
"""Begins places among the options of the strategy; others are in the recipe."""


@dataclass(frozen=True)
class Varied:
    """A place, and a range or choices to try there.

    Attributes:
        place: such as planner.solver.iterations, planner.terms.Evenness.weight, speeds.1
            for one of several, or strategy.gain for an option of the strategy.
        choices: the values; the two ends of a range.
        is_range: whether values between the ends are tried.
        log: whether the range is sampled logarithmically.
    """

    place: str
    choices: tuple[Value, ...]
    is_range: bool = False
    log: bool = False

    def holds(self, value: Value) -> bool:
        """Whether a value is in the range or among the choices."""
        if self.is_range:
            return self.choices[0] <= value <= self.choices[-1]
        return value in self.choices


def varied_from(
    texts: Sequence[str], recipe: Recipe, strategy: str = "s2c2a"
) -> tuple[Varied, ...]:
    """Parse what to vary, and check it with a recipe and a strategy.

    Args:
        texts: such as `planner.solver.iterations=5:60`,
            `c2s_fit.learning_rate=1e-4:1e-2:log`, `c2s.hidden=32,64,128`.
        recipe: the starting point.
        strategy: its name, and options to start from.

    Raises:
        S2C2AError: a place is unknown or given twice, a value has the wrong type or is
            out of the recipe's bounds, or there is nothing to vary.
    """
    parameters = tuple(_parse(text, recipe, strategy) for text in texts)
    places = [parameter.place for parameter in parameters]
    if not places or len(set(places)) < len(places):
        raise S2C2AError(
            f"{', '.join(places) or 'nothing'} to vary; "
            f"name every place once, such as {SAMPLE}"
        )
    for parameter in parameters:
        for value in parameter.choices:
            _check_value(recipe, strategy, parameter.place, value)
    return parameters


def _check_value(recipe: Recipe, strategy: str, place: str, value: Value) -> None:
    try:
        with_values(recipe, {place: value})
        strategy_named(with_options(strategy, {place: value}))
    except S2C2AError as error:
        raise S2C2AError(f"{place}={value} cannot be tried: {error}") from error


def value_at(recipe: Recipe, place: str, strategy: str = "s2c2a") -> Value:
    """The value at a place of a recipe, or of a strategy.

    Raises:
        S2C2AError: the place is unknown, or holds no number or truth value.
    """
    value: Any = recipe
    path = ""
    holder = f"recipe {recipe.name}"
    if place.startswith(STRATEGY):
        value = strategy_named(strategy)
        holder = f"strategy {value.name}"
    for name in place.removeprefix(STRATEGY).split("."):
        children = _children(value)
        if name not in children or place in NOT_VARIED:
            raise S2C2AError(
                f"nothing to vary at '{place}'{did_you_mean(name, children)}; "
                f"{path or holder} has "
                f"{_list_places(path, children)}"
            )
        value = children[name]
        path = f"{path}.{name}" if path else name
    children = _children(value)
    if children:
        raise S2C2AError(
            f"'{place}' holds several; vary one of {_list_places(place, children)}"
        )
    if not isinstance(value, Value):
        raise S2C2AError(
            f"'{place}' is {value!r}; only numbers and true or false can be varied"
        )
    return value


def with_values(recipe: Recipe, values: dict[str, Value]) -> Recipe:
    """The recipe with other values at some places.

    Raises:
        S2C2AError: the values are invalid together.
    """
    for place, value in values.items():
        if not place.startswith(STRATEGY):
            recipe = _replaced(recipe, place.split("."), value)
    recipe.collect_options()  # validates the speeds
    return recipe


def with_options(strategy: str, values: dict[str, Value]) -> str:
    """The strategy with other values of some options, as `strategy_named` reads it."""
    name, *given = OPTION.split(strategy)
    options: dict[str, Value | str] = dict(options_from(given))
    for place, value in values.items():
        if place.startswith(STRATEGY):
            options[place.removeprefix(STRATEGY)] = value
    return ",".join([name, *(f"{key}={value}" for key, value in options.items())])


def _children(value: Any) -> dict[str, Any]:
    """Fields of a dataclass, or items of a tuple by their unique name or number."""
    if is_dataclass(value):
        names = [field.name for field in fields(value) if field.init]
        return {name: getattr(value, name) for name in names}
    if not isinstance(value, tuple):
        return {}
    names = [str(getattr(item, "name", "")) for item in value]
    children = {}
    for number, (name, item) in enumerate(zip(names, value, strict=True)):
        unique = name and names.count(name) == 1
        children[name if unique else str(number)] = item
    return children


def _list_places(path: str, children: dict[str, Any]) -> str:
    """Full names of the places that can be varied, as text."""
    places = [f"{path}.{name}" if path else name for name in children]
    allowed = [place for place in places if place not in NOT_VARIED]
    return ", ".join(allowed) or "nothing inside"


def _replaced(holder: Any, path: list[str], value: Value) -> Any:
    if not path:
        return value
    children = _children(holder)
    children[path[0]] = _replaced(children[path[0]], path[1:], value)
    if is_dataclass(holder):
        return replace(holder, **children)  # type: ignore[type-var]
    return tuple(children.values())


def _parse(text: str, recipe: Recipe, strategy: str) -> Varied:
    place, _, values = text.partition("=")
    if not values:
        raise S2C2AError(f"'{text}' has no values to try; write such as {SAMPLE}")
    current = value_at(recipe, place, strategy)
    if ":" not in values:
        choices = [_parse_value(word, current, place) for word in values.split(",")]
        return Varied(place, tuple(dict.fromkeys(choices)))
    words = values.split(":")
    low = _parse_value(words[0], current, place)
    high = _parse_value(words[1], current, place)
    log = words[2:] == ["log"]
    valid_scale = len(words) == 2 or log
    too_low = log and low <= 0
    if not valid_scale or isinstance(current, bool) or low >= high or too_low:
        raise S2C2AError(
            f"'{text}' is no range; write rising low:high, low:high:log above zero, or "
            "choices with commas"
        )
    return Varied(place, (low, high), is_range=True, log=log)


def _parse_value(word: str, current: Value, place: str) -> Value:
    """A value of the type of the current one."""
    if isinstance(current, bool):
        if word in ("true", "false"):
            return word == "true"
        raise S2C2AError(
            f"'{word}' for {place}, which is {str(current).lower()} now; "
            "write true, false or both"
        )
    with suppress(ValueError):
        value = type(current)(word)
        if np.isfinite(value):
            return value
    kind = "a whole number" if isinstance(current, int) else "a number"
    raise S2C2AError(f"'{word}' for {place}, which is {current} now; write {kind}")
