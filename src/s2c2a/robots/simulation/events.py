"""What comes about while a simulated arm works: a load, a push, slipped zeros, a softer cable, sensors that are gone."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from s2c2a.errors import S2C2AError

SAMPLE = "8 load 0.05; 10 push 0.3 0 0; 12 push 0 0 0"
MAX_PAYLOAD = 50.0  # kg
KINDS = {"load": 1, "push": 3, "homed": 1, "softer": 1, "blind": 0}
"""Name -> how many numbers it takes: kg; N along x, y, z at the tip; m; a share of a
cable's stiffness."""


class Event(NamedTuple):
    """One of them.

    Attributes:
        time: when [s].
        kind: a name in `KINDS`.
        numbers: of it.
    """

    time: float
    kind: str
    numbers: tuple[float, ...]


def parse_events(text: str) -> tuple[Event, ...]:
    """As a user writes them, such as `SAMPLE`; in order.

    Raises:
        S2C2AError: it says something else.
    """
    found = [_one(part.split()) for part in text.split(";") if part.strip()]
    return tuple(sorted(found, key=lambda one: one.time))


def _one(words: Sequence[str]) -> Event:
    try:
        kind = words[1]
        numbers = tuple(float(word) for word in words[2:])
        said = Event(float(words[0]), kind, numbers)
        if (
            len(numbers) != KINDS[kind]
            or not np.isfinite([said.time, *numbers]).all()
            or said.time < 0
        ):
            raise ValueError
        if not (kind != "softer" or 0 <= numbers[0] < 1) or not (
            kind != "load" or 0 <= numbers[0] <= MAX_PAYLOAD
        ):
            raise ValueError
    except (ValueError, KeyError, IndexError) as error:
        kinds = ", ".join(f"{kind} ({count} numbers)" for kind, count in KINDS.items())
        raise S2C2AError(
            f"'{' '.join(words)}' cannot happen; say a time [s], a kind and its numbers: {kinds}, such as \"{SAMPLE}\""
        ) from error
    return said


class EventSchedule:
    """What is still to come. A robot has methods of their names."""

    def __init__(self, every: tuple[Event, ...]):
        """In order."""
        self._left = list(every)

    def until(self, time: float, robot: Any) -> None:
        """Let all happen that is due [s]."""
        while self._left and self._left[0].time <= time + 1e-9:
            _, kind, numbers = self._left.pop(0)
            happen: Callable[..., None] = getattr(robot, kind)
            happen(numbers if kind == "push" else numbers[0]) if numbers else happen()
