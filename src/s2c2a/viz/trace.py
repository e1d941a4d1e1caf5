"""A trace: an episode under a label, as it is drawn."""

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError
from s2c2a.spaces import AXIS, POSITION


@dataclass(frozen=True, eq=False)
class Trace:
    """Where an arm was after each action of an episode's run, and what was asked then; base frame.

    States may hold NaN where a real arm was not seen; desired values are NaN where
    nothing is asked of that module.

    Attributes:
        episode: what happened, with true states.
        label: name of the strategy, such as "s2c2a"; it is shown in legends.
        counted: which steps count in the mean error, shape (time,), such as those whose
            target is within reach; all if not stated.

    Raises:
        S2C2AError: the episode holds no true states, or no step of a run.
    """

    episode: Episode
    label: str
    counted: Bool[np.ndarray, " time"] | None = None

    def __post_init__(self):
        """Refuse what has nothing to draw."""
        if "states" not in self.episode.sensors or not len(self.episode.running):
            raise S2C2AError(
                f"'{self.label}' holds no true states of a run, so there is nothing to draw"
            )
        if self.counted is not None and (self.counted.shape, self.counted.dtype) != (
            self.times.shape,
            bool,
        ):
            raise S2C2AError(
                f"'{self.label}': counted is of shape {self.counted.shape}, not a truth for every step"
            )

    @cached_property
    def times(self) -> Float[np.ndarray, " time"]:
        """Of the steps [s]."""
        return self.episode["time"][self._read]

    @cached_property
    def states(self) -> Float[np.ndarray, "time modules 6"]:
        """End position [m] and end axis of every module."""
        return self.episode.sensor("states")[self._read]

    @cached_property
    def desired_positions(self) -> Float[np.ndarray, "time modules 3"]:
        """Where module ends should be [m], or NaN."""
        return self._asked("desired_positions", self.episode.arm.module_count, 3)

    @cached_property
    def desired_axes(self) -> Float[np.ndarray, "time modules 3"]:
        """Where module ends should point, unit vectors, or NaN."""
        return self._asked("desired_axes", self.episode.arm.module_count, 3)

    @cached_property
    def obstacles(self) -> Float[np.ndarray, "time obstacles 4"]:
        """Center and radius of spheres [m]; a radius that is not positive or a NaN says that there is none."""
        return self._asked("obstacles", 0, 4)

    @property
    def _read(self) -> np.ndarray:
        """Numbers of the readings after each action; before each where nothing was read after the last."""
        running = self.episode.running
        return running + (running[-1] + 1 < len(self.episode))

    def _asked(self, name: str, *shape: int) -> np.ndarray:
        asked = self.episode.get(name) is not None
        return (
            self.episode.ran(name)
            if asked
            else np.full((len(self.times), *shape), np.nan)
        )

    @property
    def followed_module(self) -> int:
        """Outermost module whose position is asked for, counted from 0; the last one where none is."""
        return _outermost_asked(self.desired_positions)

    @property
    def pointing_module(self) -> int:
        """Outermost module whose axis is asked for, counted from 0; the last one where none is."""
        return _outermost_asked(self.desired_axes)

    @property
    def followed_path(self) -> Float[np.ndarray, "time 3"]:
        """Positions of the followed module's end [m]."""
        return self.states[:, self.followed_module, POSITION]

    @property
    def desired_path(self) -> Float[np.ndarray, "time 3"]:
        """Desired positions of the followed module's end [m], or NaN."""
        return self.desired_positions[:, self.followed_module]

    def spheres(self, step: int) -> Float[np.ndarray, "spheres 4"]:
        """Center and radius of the obstacles that are there at a step [m]."""
        obstacles = self.obstacles[step]
        return obstacles[standing(obstacles)]

    @property
    def position_errors(self) -> Float[np.ndarray, " time"]:
        """Distance of the followed module's end from where it should be [m], or NaN."""
        return np.linalg.norm(self.followed_path - self.desired_path, axis=-1)

    @property
    def _counted(self) -> Bool[np.ndarray, " time"]:
        return np.ones(len(self.times), bool) if self.counted is None else self.counted

    @property
    def counted_errors(self) -> Float[np.ndarray, " counted"]:
        """Distances [m] at the steps that count and at which a position is asked for."""
        return self.position_errors[self._counted & np.isfinite(self.position_errors)]

    @property
    def uncounted_spans(self) -> list[tuple[float, float]]:
        """From when to when steps do not count [s], half a step to each side."""
        edges = np.concatenate(
            [self.times[:1], (self.times[1:] + self.times[:-1]) / 2, self.times[-1:]]
        )
        changes = np.flatnonzero(
            np.diff(np.concatenate([[True], self._counted, [True]]).astype(int))
        )
        return [
            (float(edges[start]), float(edges[end]))
            for start, end in changes.reshape(-1, 2)
        ]

    @property
    def axis_errors(self) -> Float[np.ndarray, " time"]:
        """Angle between end axis and desired axis [rad] of the pointing module, or NaN."""
        real = self.states[:, self.pointing_module, AXIS]
        desired = self.desired_axes[:, self.pointing_module]
        across = np.linalg.norm(np.cross(real, desired), axis=-1)
        return np.arctan2(across, np.sum(real * desired, axis=-1))


def standing(obstacles: Float[np.ndarray, "*batch 4"]) -> np.ndarray:
    """Which obstacles are there."""
    return np.isfinite(obstacles).all(axis=-1) & (obstacles[..., 3] > 0)


def _outermost_asked(desired: np.ndarray) -> int:
    """Last module of which something is asked at some time, or the last one of all."""
    asked = np.isfinite(desired).all(axis=-1).any(axis=0)
    return int(np.flatnonzero(asked)[-1]) if asked.any() else desired.shape[1] - 1


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
        raise S2C2AError(
            f"several traces are labeled '{twice[0]}'; give each a label of its own, for the legend"
        )


def check_same_arm(traces: Collection[Trace], arm: ArmSpec) -> None:
    """Refuse an empty list of traces, and traces with another number of modules than the arm.

    Raises:
        S2C2AError: there is no trace, or one does not fit the arm.
    """
    check_some(traces)
    for trace in traces:
        if (count := trace.episode.arm.module_count) != arm.module_count:
            raise S2C2AError(
                f"trace '{trace.label}' has {count} modules and arm '{arm.name}' has {arm.module_count}; "
                "draw a trace with the arm that it was recorded on"
            )
