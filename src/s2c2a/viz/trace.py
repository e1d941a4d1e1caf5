"""A trace: what viz draws of one run, and how it is had from an episode."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError
from s2c2a.spaces import AXIS, POSITION

SHAPES: dict[str, tuple[str | int, ...]] = {
    "times": ("time",),
    "states": ("time", "modules", 6),
    "wanted_positions": ("time", "modules", 3),
    "wanted_axes": ("time", "modules", 3),
    "obstacles": ("time", "obstacles", 4),
    "counted": ("time",),
}
_ASKED = ("wanted_positions", "wanted_axes", "obstacles")


@dataclass(frozen=True, eq=False)
class Trace:
    """One controller's run of a task, in the base frame; arrays are copied and made read-only.

    States may hold NaN where a real arm was not seen; wanted values are NaN where nothing is asked of that module.

    Attributes:
        label: name of the controller, such as "s2c2a"; it is shown in legends.
        times: rising times [s], shape (time,).
        states: end position [m] and end axis of every module, shape (time, modules, 6).
        wanted_positions: where module ends should be [m], shape (time, modules, 3), or NaN.
        wanted_axes: where module ends should point, unit vectors, shape (time, modules, 3), or NaN.
        obstacles: centre and radius of spheres [m], shape (time, obstacles, 4); a radius that is not positive or a NaN
            says that there is none.
        counted: which steps count in the mean error, shape (time,), such as those whose target is within reach; all if
            not stated.

    Raises:
        S2C2AError: a shape is wrong, times do not rise, or `counted` is not of truths.
    """

    label: str
    times: Float[np.ndarray, " time"]
    states: Float[np.ndarray, "time modules 6"]
    wanted_positions: Float[np.ndarray, "time modules 3"]
    wanted_axes: Float[np.ndarray, "time modules 3"]
    obstacles: Float[np.ndarray, "time obstacles 4"]
    counted: Bool[np.ndarray, " time"] | None = None

    def __post_init__(self):
        """Freeze the arrays and check that they fit together."""
        sizes = {}
        for name, axes in SHAPES.items():
            array = self._frozen(name)
            expected = [sizes.get(axis, axis) for axis in axes]
            fits = array.ndim == len(axes) and all(map(_fits, array.shape, expected))
            if not fits or (not array.size and name != "obstacles"):
                shape = str(tuple(expected)).replace("'", "")
                raise S2C2AError(
                    f"trace '{self.label}': {name} has shape {array.shape}, expected {shape}; "
                    "axes are (time, modules or obstacles, features), with at least one step and at least one module"
                )
            sizes.update(zip(axes, array.shape, strict=True))
        if not (np.isfinite(self.times).all() and (np.diff(self.times) > 0).all()):
            raise S2C2AError(
                f"trace '{self.label}': times must be finite and rise from step to step; they are in seconds"
            )

    def _frozen(self, name: str) -> np.ndarray:
        """An array of its own that nobody can change, kept under its name."""
        value, truths = getattr(self, name), name == "counted"
        try:
            array = np.ones(self.times.shape, bool) if value is None else np.array(value, None if truths else float)
        except (TypeError, ValueError) as error:
            raise S2C2AError(f"trace '{self.label}': {name} is not an array of numbers: {error}") from error
        if truths and array.dtype != bool:
            raise S2C2AError(f"trace '{self.label}': counted holds {array.dtype}, expected truths, one a step")
        array.setflags(write=False)
        object.__setattr__(self, name, array)
        return array

    @classmethod
    def without_target(cls, label: str, times, states) -> "Trace":
        """A trace of an arm of which nothing is asked, such as one episode of a recording."""
        nothing = np.full((*np.shape(states)[:2], 3), np.nan)
        return cls(label, times, states, nothing, nothing, np.zeros((np.size(times), 0, 4)))

    @property
    def module_count(self) -> int:
        """Number of modules."""
        return self.states.shape[1]

    @property
    def followed_module(self) -> int:
        """Outermost module whose position is asked for, counted from 0; the last one where none is."""
        return _outermost_asked(self.wanted_positions)

    @property
    def pointing_module(self) -> int:
        """Outermost module whose axis is asked for, counted from 0; the last one where none is."""
        return _outermost_asked(self.wanted_axes)

    @property
    def followed_path(self) -> Float[np.ndarray, "time 3"]:
        """Positions of the followed module's end [m]."""
        return self.states[:, self.followed_module, POSITION]

    @property
    def wanted_path(self) -> Float[np.ndarray, "time 3"]:
        """Wanted positions of the followed module's end [m], or NaN."""
        return self.wanted_positions[:, self.followed_module]

    def spheres(self, step: int) -> Float[np.ndarray, "spheres 4"]:
        """Centre and radius of the obstacles that are there at a step [m]."""
        obstacles = self.obstacles[step]
        return obstacles[standing(obstacles)]

    @property
    def position_errors(self) -> Float[np.ndarray, " time"]:
        """Distance of the followed module's end from where it should be [m], or NaN."""
        return np.linalg.norm(self.followed_path - self.wanted_path, axis=-1)

    @property
    def counted_errors(self) -> Float[np.ndarray, " counted"]:
        """Distances [m] at the steps that count and at which a position is asked for."""
        return self.position_errors[self.counted & np.isfinite(self.position_errors)]

    @property
    def uncounted_spans(self) -> list[tuple[float, float]]:
        """From when to when steps do not count [s], half a step to each side."""
        edges = np.concatenate([self.times[:1], (self.times[1:] + self.times[:-1]) / 2, self.times[-1:]])
        changes = np.flatnonzero(np.diff(np.concatenate([[True], self.counted, [True]]).astype(int)))
        return [(float(edges[start]), float(edges[end])) for start, end in changes.reshape(-1, 2)]

    @property
    def axis_errors(self) -> Float[np.ndarray, " time"]:
        """Angle between end axis and wanted axis [rad] of the pointing module, or NaN."""
        real, wanted = self.states[:, self.pointing_module, AXIS], self.wanted_axes[:, self.pointing_module]
        across = np.linalg.norm(np.cross(real, wanted), axis=-1)
        return np.arctan2(across, np.sum(real * wanted, axis=-1))


def standing(obstacles: Float[np.ndarray, "*batch 4"]) -> np.ndarray:
    """Which obstacles are there."""
    return np.isfinite(obstacles).all(axis=-1) & (obstacles[..., 3] > 0)


def _outermost_asked(wanted: np.ndarray) -> int:
    """Last module of which something is asked at some time, or the last one of all."""
    asked = np.isfinite(wanted).all(axis=-1).any(axis=0)
    return int(np.flatnonzero(asked)[-1]) if asked.any() else wanted.shape[1] - 1


def _fits(size: int, expected: int | str) -> bool:
    return isinstance(expected, str) or size == expected


def trace_of(episode: Episode, label: str | None = None, counted: np.ndarray | None = None) -> Trace:
    """What is drawn of an episode's run: where the arm was after each action, and what was asked then.

    Args:
        episode: with true states.
        label: for legends; its strategy's name if not stated.
        counted: which steps count in the mean error; all if not stated.

    Raises:
        S2C2AError: it holds no true states.
    """
    if "states" not in episode.sensors:
        raise S2C2AError("this episode holds no true states, so there is nothing to draw")
    whole = len(episode.running) and episode.running[-1] + 1 >= len(episode)  # nothing was read after the last action
    states = episode.sensor("states")[episode.running] if whole else episode.after("states")
    times = episode.ran("time") if whole else episode.times()
    nothing = Trace.without_target(label or str(episode.options.get("strategy", "")), times, states)
    asked: dict[str, Any] = {name: episode.ran(name) for name in _ASKED if episode.get(name) is not None}
    return replace(nothing, counted=counted, **asked)


def check_some(traces: Collection) -> None:
    """Refuse to draw nothing.

    Raises:
        S2C2AError: there is no trace.
    """
    if not traces:
        raise S2C2AError("there is no trace to draw; give at least one")


def check_told_apart(traces: Collection[Trace]) -> None:
    """Refuse an empty list of traces, and traces that one label stands for.

    Raises:
        S2C2AError: there is no trace, or two have the same label.
    """
    check_some(traces)
    labels = [trace.label for trace in traces]
    twice = [label for label in dict.fromkeys(labels) if labels.count(label) > 1]
    if twice:
        raise S2C2AError(f"several traces are labelled '{twice[0]}'; give each a label of its own, for the legend")


def check_same_arm(traces: Collection[Trace], arm: ArmSpec) -> None:
    """Refuse an empty list of traces, and traces with another number of modules than the arm.

    Raises:
        S2C2AError: there is no trace, or one does not fit the arm.
    """
    check_some(traces)
    for trace in traces:
        if trace.module_count != arm.module_count:
            raise S2C2AError(
                f"trace '{trace.label}' has {trace.module_count} modules and arm '{arm.name}' has {arm.module_count}; "
                "draw a trace with the arm that it was recorded on"
            )
