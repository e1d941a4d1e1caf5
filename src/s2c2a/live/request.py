"""Requests of the driver: frozen values, their limits, and sliders that change them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.obstacles import (
    CENTER,
    CORE,
    HALF_SPACE,
    SKIN,
    THRESHOLD,
    is_half_space,
    normal_of,
)

Point = tuple[float, float, float]

MAX_OBSTACLES = 16
SPEEDS = (0.1, 4.0)
WEIGHT_FACTORS = (0.0, 10.0)


@dataclass(frozen=True)
class Obstacle:
    """An obstacle to avoid.

    Attributes:
        center: [m], base frame.
        threshold: r [m], of the distance from its core.
        core: see `s2c2a.obstacles`; that of a sphere by default.
    """

    center: Point
    threshold: float
    core: tuple[float, ...] = (0.0,) * 8

    @property
    def is_wall(self) -> bool:
        """Whether it is a half-space, whose center is beyond any arm."""
        return is_half_space(self.row)

    @property
    def place(self) -> Point:
        """The point by which it is moved [m]: its center, or one of a wall's surface."""
        return point(np.add(self.center, self._to_place))

    def at(self, place: Point) -> "Obstacle":
        """The obstacle moved to a place [m]."""
        return replace(self, center=point(np.subtract(place, self._to_place)))

    @property
    def _to_place(self) -> np.ndarray:
        return HALF_SPACE * normal_of(self.row) if self.is_wall else np.zeros(3)

    @property
    def row(self) -> np.ndarray:
        """The obstacle as a row of the goal."""
        return np.array([*self.center, self.threshold, *self.core])

    @classmethod
    def of(cls, row: np.ndarray) -> "Obstacle":
        """The obstacle of a row of a goal."""
        core = tuple(row[CORE].tolist())
        return cls(point(row[CENTER]), float(row[THRESHOLD]), core)


class WeightFactors(NamedTuple):
    """Factors of the weights of the planner's cost terms."""

    position: float = 1.0
    axis: float = 1.0
    obstacle: float = 1.0
    change: float = 1.0


UNCHANGED = WeightFactors()


@dataclass(frozen=True)
class Request:
    """All inputs of the driver; `RequestLimits.changed` makes new requests.

    Attributes:
        driven: whether a browser drives; otherwise the arm holds.
        stopped: whether Stop was pressed.
        target: desired tip position [m], base frame, or None.
        axis: desired end axis, or None for any.
        shape: desired ends of the other modules, from the base [m], base frame, or None
            for any; the arm takes the curve through them (`curve_through`).
        task: name of the task played instead of the target, or None.
        playing: whether the task advances.
        speed: of the task; 1 is the protocol's speed.
        obstacles: added by the driver to the task's obstacles.
        weights: factors of the cost terms.
        payload: at the tip [kg].
        force: external force at the tip [N], base frame.
        coupling: part of the paper's coupling between the modules' sensors (eq. (11)),
            0 to 1.
        noise: standard deviation of the sensors' noise, in parts of the full range.
    """

    driven: bool = False
    stopped: bool = False
    target: Point | None = None
    axis: Point | None = None
    shape: tuple[Point, ...] | None = None
    task: str | None = None
    playing: bool = False
    speed: float = 1.0
    obstacles: tuple[Obstacle, ...] = ()
    weights: WeightFactors = UNCHANGED
    payload: float = 0.0
    force: Point = (0.0, 0.0, 0.0)
    coupling: float = 0.0
    noise: float = 0.0

    @property
    def ends(self) -> tuple[Point, ...] | None:
        """Desired ends of all modules [m], if the driver gives a shape and a target."""
        if self.task is not None or self.shape is None or self.target is None:
            return None
        return (*self.shape, self.target)


@dataclass(frozen=True)
class RequestLimits:
    """Limits of a request.

    Attributes:
        reach: largest distance of a target or an obstacle from the base [m].
        payload: largest payload [kg].
        force: largest force along each axis [N].
        noise: largest noise, in parts of the full range.
        tasks: names of the tasks.
        modules: number of modules.
    """

    reach: float
    payload: float
    force: float
    noise: float
    tasks: tuple[str, ...]
    modules: int

    @classmethod
    def of(
        cls, arm: ArmSpec, tasks: tuple[str, ...], disturbed: bool = True
    ) -> "RequestLimits":
        """Limits of an arm: twice its length for targets, its weight for loads.

        Without `disturbed`, payload and force are zero.
        """
        mass = arm.mass if disturbed else 0.0
        return cls(
            reach=2.0 * arm.length,
            payload=round(mass, 3),
            force=round(9.81 * mass, 2),
            noise=0.1,
            tasks=tasks,
            modules=arm.module_count,
        )

    def changed(self, request: Request, **changes: Any) -> Request:
        """The request with changes clipped to the limits; ignores invalid changes."""
        rules = self._rules()
        valid = {}
        for name in rules.keys() & changes.keys():
            try:
                valid[name] = rules[name](changes[name])
            except (TypeError, ValueError, AttributeError, KeyError, OverflowError):
                continue
        return replace(request, **valid)

    def _rules(self) -> dict[str, Callable[[Any], Any]]:
        """Functions that check and clip the value of each field."""
        return {
            "driven": bool,
            "stopped": bool,
            "playing": bool,
            "speed": partial(_clip, low=SPEEDS[0], high=SPEEDS[1]),
            "payload": partial(_clip, low=0.0, high=self.payload),
            "coupling": partial(_clip, low=0.0, high=1.0),
            "noise": partial(_clip, low=0.0, high=self.noise),
            "target": partial(_optional, self._clip_point),
            "axis": partial(_optional, _unit),
            "shape": partial(_optional, self._shape),
            "task": partial(_optional, self._task),
            "obstacles": self._obstacles,
            "weights": lambda value: WeightFactors(
                *_clip(value, *WEIGHT_FACTORS, (4,))
            ),
            "force": lambda value: point(_clip(value, -self.force, self.force, (3,))),
        }

    def _task(self, name: Any) -> str:
        return self.tasks[self.tasks.index(name)]

    def _shape(self, values: Any) -> tuple[Point, ...]:
        ends = _clip(values, shape=(self.modules - 1, 3))
        return tuple(self._clip_point(end) for end in ends)

    def _obstacles(self, values: Any) -> tuple[Obstacle, ...]:
        return tuple(self._obstacle(value) for value in tuple(values)[:MAX_OBSTACLES])

    def _obstacle(self, value: Any) -> Obstacle:
        core = tuple(_clip(value.core, shape=(8,)))
        least = SKIN if any(core) else 0.01
        threshold = _clip(value.threshold, least, self.reach / 4)
        clipped = Obstacle(point(value.center), threshold, core)
        return clipped.at(self._clip_point(clipped.place))

    def _clip_point(self, value: Any) -> Point:
        """The point, projected to the sphere of `reach` if it is outside."""
        vector = np.array(_clip(value, shape=(3,)))
        distance = max(float(np.linalg.norm(vector)), 1e-9)
        return point(vector * min(1.0, self.reach / distance))


@dataclass(frozen=True)
class RequestSlider:
    """A slider on one number of the request.

    Attributes:
        label: beside the slider.
        low: lower end, in the slider's unit.
        high: upper end; a slider whose ends are equal is not shown.
        step: of the slider.
        field: of the request.
        element: index in the field, or None for a scalar field.
        scale: slider units per unit of the request.
    """

    label: str
    low: float
    high: float
    step: float
    field: str
    element: int | None = None
    scale: float = 1.0

    def value(self, request: Request) -> float:
        """The request's number in the slider's unit, clipped to the slider's ends."""
        number = getattr(request, self.field)
        if self.element is not None:
            number = number[self.element]
        return float(np.clip(self.scale * number, self.low, self.high))

    def change(self, request: Request, value: float) -> dict[str, Any]:
        """Change of the request for a value of the slider."""
        number = value / self.scale
        if self.element is None:
            return {self.field: number}
        numbers = list(getattr(request, self.field))
        numbers[self.element] = number
        return {self.field: tuple(numbers)}


SPEED_SLIDER = RequestSlider("Speed", 0.25, 3.0, 0.25, "speed")
WEIGHT_SLIDERS = (
    RequestSlider("target μp", 0.0, 4.0, 0.1, "weights", 0),
    RequestSlider("direction μo", 0.0, 4.0, 0.1, "weights", 1),
    RequestSlider("obstacles μob", 0.0, 4.0, 0.1, "weights", 2),
    RequestSlider("change μd", 0.0, 4.0, 0.1, "weights", 3),
)


def fault_sliders(limits: RequestLimits, coupled: bool) -> tuple[RequestSlider, ...]:
    """Sliders of disturbances and sensor faults.

    Args:
        limits: of the requests.
        coupled: whether the paper's sensor coupling fits the arm.
    """
    force = limits.force
    coupling = 100.0 if coupled else 0.0
    return (
        RequestSlider(
            "Payload [g]", 0.0, 1000 * limits.payload, 5.0, "payload", scale=1000
        ),
        *(
            RequestSlider(
                f"Force {axis} [N]", -force, force, force / 20, "force", element
            )
            for element, axis in enumerate("xyz")
        ),
        RequestSlider(
            "Sensor noise [%]", 0.0, 100 * limits.noise, 0.1, "noise", scale=100
        ),
        RequestSlider("Sensor coupling [%]", 0.0, coupling, 5.0, "coupling", scale=100),
    )


def point(values: Iterable[Any]) -> Point:
    """Three numbers as Python floats."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def _optional(convert: Callable[[Any], Any], value: Any) -> Any:
    return None if value is None else convert(value)


def _clip(
    value: Any, low: float = -1e6, high: float = 1e6, shape: tuple[int, ...] = ()
) -> Any:
    """Finite numbers of a shape, clipped to limits, as Python floats."""
    if isinstance(value, str | bytes | bool):
        raise TypeError(f"got {value!r}, expected numbers")
    numbers = np.asarray(value, dtype=float)
    if numbers.shape != shape or not np.isfinite(numbers).all():
        raise ValueError(f"got {value!r}, expected finite numbers of shape {shape}")
    return np.clip(numbers, low, high).tolist()


def _unit(value: Any) -> Point:
    vector = np.array(_clip(value, shape=(3,)))
    length = float(np.linalg.norm(vector))
    if length < 1e-6:
        raise ValueError("got a zero vector, expected a direction")
    return point(vector / length)
