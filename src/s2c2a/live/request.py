"""What the driver asks for: frozen values, brought within their limits whatever a client sends."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec

Point = tuple[float, float, float]

MOST_OBSTACLES = 8
SPEEDS = (0.1, 4.0)
FACTORS = (0.0, 10.0)


@dataclass(frozen=True)
class Obstacle:
    """A sphere to keep out of: centre and threshold r [m], base frame."""

    centre: Point
    threshold: float


@dataclass(frozen=True)
class Weights:
    """What the losses' weights are multiplied by."""

    position: float = 1.0
    axis: float = 1.0
    obstacle: float = 1.0
    change: float = 1.0


@dataclass(frozen=True)
class Request:
    """Everything that a driver can ask for; `RequestLimits.changed` makes new ones.

    Attributes:
        driven: whether somebody drives; if not, the arm is stopped.
        stopped: whether the driver stopped it.
        target: wanted tip [m], base frame, or None for nothing wanted.
        axis: wanted end axis, or None for any.
        task: name of the task that is played instead of the target, or None.
        playing: whether the task goes on.
        speed: of the task; one is the protocol's.
        obstacles: added by the driver, beside the task's own.
        weights: factors of the losses.
        payload: at the tip [kg].
        push: force at the tip [N], base frame.
        coupling: part of the paper's leak between the modules' sensors (eq. (11)), 0 to 1.
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
    weights: Weights = Weights()
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
    def of(cls, arm: ArmSpec, tasks: tuple[str, ...], disturbed: bool = True) -> "RequestLimits":
        """Twice the arm's length around it; where it can be pushed and loaded, its own weight, to each side as well."""
        mass = sum(module.mass for module in arm.modules) if disturbed else 0.0
        return cls(reach=2.0 * arm.length, payload=round(mass, 3), push=round(9.81 * mass, 2), noise=0.1, tasks=tasks)

    def changed(self, request: Request, **changes: Any) -> Request:
        """The request with changes brought within the limits; a change that makes no sense is passed over."""
        rules, sound = self._rules(), {}
        for name in rules.keys() & changes.keys():
            try:
                sound[name] = rules[name](changes[name])
            except (TypeError, ValueError, AttributeError, KeyError, OverflowError):
                continue
        return replace(request, **sound)

    def _rules(self) -> dict[str, Callable[[Any], Any]]:
        return {
            "driven": bool,
            "stopped": bool,
            "playing": bool,
            "target": lambda value: None if value is None else self._inside(value),
            "axis": lambda value: None if value is None else _unit(value),
            "task": lambda value: (None, *self.tasks)[(None, *self.tasks).index(value)],  # where there is one
            "speed": lambda value: _number(value, *SPEEDS),
            "obstacles": lambda value: tuple(self._obstacle(one) for one in tuple(value)[:MOST_OBSTACLES]),
            "weights": lambda value: Weights(*(_number(getattr(value, name), *FACTORS) for name in vars(Weights()))),
            "payload": lambda value: _number(value, 0.0, self.payload),
            "push": lambda value: point(_vector(value, self.push)),
            "coupling": lambda value: _number(value, 0.0, 1.0),
            "noise": lambda value: _number(value, 0.0, self.noise),
        }

    def _obstacle(self, value: Any) -> Obstacle:
        return Obstacle(self._inside(value.centre), _number(value.threshold, 0.01, self.reach / 4))

    def _inside(self, value: Any) -> Point:
        """The point, drawn to the sphere around the base if it is outside of it."""
        vector = _vector(value)
        return point(vector * min(1.0, self.reach / max(float(np.linalg.norm(vector)), 1e-9)))


def point(values: Iterable[Any]) -> Point:
    """Three numbers as Python's own."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def _number(value: Any, low: float, high: float) -> float:
    if isinstance(value, str | bytes | bool):
        raise TypeError("a number is needed")
    number = float(value)
    if not np.isfinite(number):
        raise ValueError("a finite number is needed")
    return float(np.clip(number, low, high))


def _vector(value: Any, most: float = 1e6) -> Float[np.ndarray, "3"]:
    vector = np.asarray(value, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError("three finite numbers are needed")
    return np.clip(vector, -most, most)


def _unit(value: Any) -> Point:
    vector = _vector(value)
    length = float(np.linalg.norm(vector))
    if length < 1e-6:
        raise ValueError("a direction is needed")
    return point(vector / length)
