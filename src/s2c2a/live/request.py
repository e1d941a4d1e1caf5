"""What the driver asks for: frozen values, brought within their limits whatever a client sends, and sliders on them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from s2c2a.arm import ArmSpec

Point = tuple[float, float, float]

MAX_OBSTACLES = 8
SPEEDS = (0.1, 4.0)
FACTORS = (0.0, 10.0)


@dataclass(frozen=True)
class Obstacle:
    """A sphere to keep out of: center and threshold r [m], base frame."""

    center: Point
    threshold: float


class Weights(NamedTuple):
    """What the terms' weights are multiplied by."""

    position: float = 1.0
    axis: float = 1.0
    obstacle: float = 1.0
    change: float = 1.0


UNCHANGED = Weights()


@dataclass(frozen=True)
class Request:
    """Everything that a driver can ask for; `RequestLimits.changed` makes new ones.

    Attributes:
        driven: whether somebody drives; if not, the arm is stopped.
        stopped: whether the driver stopped it.
        target: desired tip [m], base frame, or None for nothing desired.
        axis: desired end axis, or None for any.
        task: name of the task that is played instead of the target, or None.
        playing: whether the task goes on.
        speed: of the task; one is the protocol's.
        obstacles: added by the driver, beside the task's own.
        weights: factors of the terms.
        payload: at the tip [kg].
        push: force at the tip [N], base frame.
        coupling: part of the paper's leak between the modules' sensors (eq. (11)), 0 to
            1.
        noise: of the sensors, standard deviation in parts of the full range.
    """

    driven: bool = False
    stopped: bool = False
    target: Point | None = None
    axis: Point | None = None
    task: str | None = None
    playing: bool = False
    speed: float = 1.0
    obstacles: tuple[Obstacle, ...] = ()
    weights: Weights = UNCHANGED
    payload: float = 0.0
    push: Point = (0.0, 0.0, 0.0)
    coupling: float = 0.0
    noise: float = 0.0


@dataclass(frozen=True)
class RequestLimits:
    """How far a request may go.

    Attributes:
        reach: largest distance of a target or an obstacle from the base [m].
        payload: heaviest payload [kg].
        push: largest force along each axis [N].
        noise: largest part of the full range.
        tasks: tasks by name.
    """

    reach: float
    payload: float
    push: float
    noise: float
    tasks: tuple[str, ...]

    @classmethod
    def of(
        cls, arm: ArmSpec, tasks: tuple[str, ...], disturbed: bool = True
    ) -> "RequestLimits":
        """Twice the arm's length around it; where it can be pushed and loaded, its own weight, to each side as well."""
        mass = sum(module.mass for module in arm.modules) if disturbed else 0.0
        return cls(
            reach=2.0 * arm.length,
            payload=round(mass, 3),
            push=round(9.81 * mass, 2),
            noise=0.1,
            tasks=tasks,
        )

    def changed(self, request: Request, **changes: Any) -> Request:
        """The request with changes brought within the limits; a change that makes no sense is passed over."""
        rules = self._rules()
        sound = {}
        for name in rules.keys() & changes.keys():
            try:
                sound[name] = rules[name](changes[name])
            except (TypeError, ValueError, AttributeError, KeyError, OverflowError):
                continue
        return replace(request, **sound)

    def _rules(self) -> dict[str, Callable[[Any], Any]]:
        numbers = {
            "speed": SPEEDS,
            "payload": (0.0, self.payload),
            "coupling": (0.0, 1.0),
            "noise": (0.0, self.noise),
        }
        return {
            **{
                name: partial(_sound, low=low, high=high)
                for name, (low, high) in numbers.items()
            },
            **dict.fromkeys(("driven", "stopped", "playing"), bool),
            "target": lambda value: None if value is None else self._inside(value),
            "axis": lambda value: None if value is None else _unit(value),
            # where there is one
            "task": lambda value: (None, *self.tasks)[(None, *self.tasks).index(value)],
            "obstacles": lambda value: tuple(
                self._obstacle(one) for one in tuple(value)[:MAX_OBSTACLES]
            ),
            "weights": lambda value: Weights(*_sound(value, *FACTORS, shape=(4,))),
            "push": lambda value: point(_sound(value, -self.push, self.push, (3,))),
        }

    def _obstacle(self, value: Any) -> Obstacle:
        return Obstacle(
            self._inside(value.center), _sound(value.threshold, 0.01, self.reach / 4)
        )

    def _inside(self, value: Any) -> Point:
        """The point, drawn to the sphere around the base if it is outside of it."""
        vector = np.array(_sound(value, shape=(3,)))
        return point(
            vector * min(1.0, self.reach / max(float(np.linalg.norm(vector)), 1e-9))
        )


@dataclass(frozen=True)
class Knob:
    """A slider on one number of the request.

    Attributes:
        label: beside it.
        low: where it begins, in its own unit.
        high: where it ends; one that ends where it begins is not shown.
        step: of the slider.
        name: of what it changes in the request.
        place: of that, where it is several numbers.
        scale: how many of its units are one of the request's.
    """

    label: str
    low: float
    high: float
    step: float
    name: str
    place: int | None = None
    scale: float = 1.0

    def shown(self, request: Request) -> float:
        """The request's number in the slider's unit, within its ends whoever has asked for it."""
        whole = getattr(request, self.name)
        number = whole if self.place is None else whole[self.place]
        return float(np.clip(self.scale * number, self.low, self.high))

    def change(self, request: Request, shown: float) -> dict[str, Any]:
        """What to ask for when the slider shows a number."""
        whole = getattr(request, self.name)
        number = shown / self.scale
        place = self.place
        return {
            self.name: number
            if place is None
            else (*whole[:place], number, *whole[place + 1 :])
        }


SPEED = Knob("Speed", 0.25, 3.0, 0.25, "speed")
FACTORED = ("target μp", "direction μo", "obstacles μob", "change μd")
WEIGHTS = tuple(
    Knob(label, 0.0, 4.0, 0.1, "weights", place) for place, label in enumerate(FACTORED)
)


def faults(limits: RequestLimits, couples: bool) -> tuple[Knob, ...]:
    """What a driver can make go wrong; `couples`: whether the paper's leak between the sensors fits the arm."""
    push = limits.push
    return (
        Knob("Payload [g]", 0.0, 1000 * limits.payload, 5.0, "payload", scale=1000),
        *(
            Knob(f"Push {name} [N]", -push, push, push / 20, "push", place)
            for place, name in enumerate("xyz")
        ),
        Knob("Sensor noise [%]", 0.0, 100 * limits.noise, 0.1, "noise", scale=100),
        Knob("Sensor coupling [%]", 0.0, 100.0 * couples, 5.0, "coupling", scale=100),
    )


def point(values: Iterable[Any]) -> Point:
    """Three numbers as Python's own."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def _sound(
    value: Any, low: float = -1e6, high: float = 1e6, shape: tuple[int, ...] = ()
) -> Any:
    """Finite numbers of this shape, brought within their limits, as Python's own."""
    if isinstance(value, str | bytes | bool):
        raise TypeError("numbers are needed")
    numbers = np.asarray(value, dtype=float)
    if numbers.shape != shape or not np.isfinite(numbers).all():
        raise ValueError(f"finite numbers of shape {shape} are needed")
    return np.clip(numbers, low, high).tolist()


def _unit(value: Any) -> Point:
    vector = np.array(_sound(value, shape=(3,)))
    length = float(np.linalg.norm(vector))
    if length < 1e-6:
        raise ValueError("a direction is needed")
    return point(vector / length)
