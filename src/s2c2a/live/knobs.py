"""Sliders on one number of the request each: which ones there are, as data."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from s2c2a.live.request import Request, RequestLimits, Weights


@dataclass(frozen=True)
class Knob:
    """A slider on one number of the request.

    Attributes:
        label: beside it.
        low: where it begins, in its own unit.
        high: where it ends; one that ends where it begins is not shown.
        step: of the slider.
        name: of what it changes in the request.
        part: of that: a field of weights, a place in a vector.
        scale: how many of its units are one of the request's.
    """

    label: str
    low: float
    high: float
    step: float
    name: str
    part: str | int | None = None
    scale: float = 1.0

    def shown(self, request: Request) -> float:
        """The request's number in the slider's unit, within its ends whoever has asked for it."""
        whole = getattr(request, self.name)
        if isinstance(self.part, int):
            whole = whole[self.part]
        elif self.part is not None:
            whole = getattr(whole, self.part)
        return float(np.clip(self.scale * whole, self.low, self.high))

    def change(self, request: Request, shown: float) -> dict[str, Any]:
        """What to ask for when the slider shows a number."""
        whole, number = getattr(request, self.name), shown / self.scale
        if isinstance(self.part, int):
            return {self.name: (*whole[: self.part], number, *whole[self.part + 1 :])}
        return {self.name: number if self.part is None else replace(whole, **{self.part: number})}


SPEED = Knob("Speed", 0.25, 3.0, 0.25, "speed")
WEIGHTS = tuple(
    Knob(label, 0.0, 4.0, 0.1, "weights", name)
    for name, label in zip(vars(Weights()), ("target μp", "direction μo", "obstacles μob", "change μd"), strict=True)
)


def faults(limits: RequestLimits, couples: bool) -> tuple[Knob, ...]:
    """What a driver can make go wrong; `couples`: whether the paper's leak between the sensors fits the arm."""
    push = limits.push
    return (
        Knob("Payload [g]", 0.0, 1000 * limits.payload, 5.0, "payload", scale=1000),
        *(Knob(f"Push {name} [N]", -push, push, push / 20, "push", place) for place, name in enumerate("xyz")),
        Knob("Sensor noise [%]", 0.0, 100 * limits.noise, 0.1, "noise", scale=100),
        Knob("Sensor coupling [%]", 0.0, 100.0 * couples, 5.0, "coupling", scale=100),
    )
