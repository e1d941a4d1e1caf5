"""What a sweep varies: places in a recipe, by name, and the values that are tried there."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from s2c2a.errors import S2C2AError
from s2c2a.strategies import Recipe

Value = bool | int | float
SAMPLE = "planner.solver.iterations=5:60, c2s_fit.learning_rate=1e-4:1e-2:log or c2s.hidden=32,64,128"
NOT_VARIED = ("name", "planner.guard", "planner.own_code", "c2s.model")
"""The first is no choice, the second is the task's, the third the user's, the last
makes another recipe."""


@dataclass(frozen=True)
class Varied:
    """A place in a recipe and what is tried there: a range or some choices.

    Attributes:
        place: such as planner.solver.iterations, planner.terms.Evenness.weight, or
            speeds.1 for one of several.
        choices: the values; or the ends of the range.
        is_range: whether all between is tried as well.
        log: whether small values are tried as densely as large ones, by their
            logarithm.
    """

    place: str
    choices: tuple[Value, ...]
    is_range: bool = False
    log: bool = False

    def holds(self, value: Value) -> bool:
        """Whether a value is among what is tried."""
        return (
            self.choices[0] <= value <= self.choices[-1]
            if self.is_range
            else value in self.choices
        )


def varied_from(texts: Sequence[str], recipe: Recipe) -> tuple[Varied, ...]:
    """What a user writes, checked against a recipe.

    Args:
        texts: such as `planner.solver.iterations=5:60`,
            `c2s_fit.learning_rate=1e-4:1e-2:log`, `c2s.hidden=32,64,128`.
        recipe: to begin from.

    Raises:
        S2C2AError: no such place, a value of another kind or beyond what the recipe
            allows, nothing, or a place twice.
    """
    every = tuple(_one(text, recipe) for text in texts)
    places = [one.place for one in every]
    if not every or len(set(places)) < len(places):
        raise S2C2AError(
            f"{', '.join(places) or 'nothing'} to vary; name every place once, such as {SAMPLE}"
        )
    for place, value in ((one.place, value) for one in every for value in one.choices):
        try:
            with_values(recipe, {place: value})
        except S2C2AError as error:
            raise S2C2AError(f"{place}={value} cannot be tried: {error}") from error
    return every


def value_at(recipe: Recipe, place: str) -> Value:
    """What a recipe has there.

    Raises:
        S2C2AError: no such place, or no number or truth value there.
    """
    found: Any = recipe
    for depth, step in enumerate(parts := place.split(".")):
        where = ".".join(parts[:depth])
        inside = _inside(found)
        if step not in inside or place in NOT_VARIED:
            holder = where or f"recipe {recipe.name}"
            raise S2C2AError(
                f"nothing to vary at '{place}'; {holder} has {_known(where, inside)}"
            )
        found = inside[step]
    if inside := _inside(found):
        raise S2C2AError(
            f"'{place}' holds several; vary one of {_known(place, inside)}"
        )
    if not isinstance(found, Value):
        raise S2C2AError(
            f"'{place}' is {found!r}; only numbers and true or false can be varied"
        )
    return found


def with_values(recipe: Recipe, values: dict[str, Value]) -> Recipe:
    """The recipe with other values at some places.

    Raises:
        S2C2AError: they make no sound recipe.
    """
    for place, value in values.items():
        recipe = _put(recipe, place.split("."), value)
    recipe.collect_options()  # says what speeds can be
    return recipe


def _inside(found: Any) -> dict[str, Any]:
    """Parts by name, by their own if they have one, or by number; none where there is a plain value."""
    if is_dataclass(found):
        return {
            field.name: getattr(found, field.name)
            for field in fields(found)
            if field.init
        }
    if not isinstance(found, tuple):
        return {}
    names = [getattr(value, "name", None) for value in found]
    shown = (
        name if name and names.count(name) == 1 else str(number)
        for number, name in enumerate(names)
    )
    return dict(zip(shown, found, strict=True))


def _known(where: str, inside: dict[str, Any]) -> str:
    """What can be varied there, in full."""
    places = [f"{where}.{name}" if where else name for name in inside]
    return (
        ", ".join(place for place in places if place not in NOT_VARIED)
        or "nothing inside"
    )


def _put(found: Any, steps: list[str], value: Value) -> Any:
    if not steps:
        return value
    inside = _inside(found)
    inside[steps[0]] = _put(inside[steps[0]], steps[1:], value)
    return replace(found, **inside) if is_dataclass(found) else tuple(inside.values())  # type: ignore[type-var]


def _one(text: str, recipe: Recipe) -> Varied:
    place, separator, tried = text.partition("=")
    if not separator or not tried:
        raise S2C2AError(f"'{text}' says not what to try; write such as {SAMPLE}")
    now = value_at(recipe, place)
    if ":" not in tried:
        return Varied(
            place,
            tuple(dict.fromkeys(_value(word, now, place) for word in tried.split(","))),
        )
    low, high, *scale = tried.split(":")
    ends = _value(low, now, place), _value(high, now, place)
    if (
        scale not in ([], ["log"])
        or isinstance(now, bool)
        or not ends[0] < ends[1]
        or (scale and ends[0] <= 0)
    ):
        raise S2C2AError(
            f"'{text}' is no range; write rising low:high, low:high:log above zero, or choices with commas"
        )
    return Varied(place, ends, is_range=True, log=bool(scale))


def _value(word: str, now: Value, place: str) -> Value:
    """A word as the kind of value that is there now."""
    if isinstance(now, bool):
        if word in ("true", "false"):
            return word == "true"
        raise S2C2AError(
            f"'{word}' for {place}, which is {str(now).lower()} now; write true, false or both"
        )
    with suppress(ValueError):
        if np.isfinite(value := type(now)(word)):
            return value
    kind = "a whole number" if isinstance(now, int) else "a number"
    raise S2C2AError(f"'{word}' for {place}, which is {now} now; write {kind}")
