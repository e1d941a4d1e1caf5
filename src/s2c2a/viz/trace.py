"""Labeled episodes, ready to be drawn."""

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError, counted
from s2c2a.obstacles import THRESHOLD, rows_of
from s2c2a.spaces import AXIS, POSITION, States
from s2c2a.viz.arrays import Goals, Obstacles, Points, Series

STDS = 2.0  # standard deviations in the band and the tube around a prediction


@dataclass(frozen=True, eq=False)
class Trace:
    """True states after each action of a run, with the desired values; base frame.

    States are NaN where a real arm was not measured. Desired values are NaN where a
    module has no goal.

    Attributes:
        episode: the run, with true states.
        label: name of the strategy, such as "s2c2a"; shown in legends.
        counted: steps that count in the mean error, shape (time,), such as those whose
            target is within reach; None for all.

    Raises:
        S2C2AError: the episode has no true states, or no step of a run.
    """

    episode: Episode
    label: str
    counted: Bool[np.ndarray, " time"] | None = None

    def __post_init__(self):
        """Check that there is something to draw."""
        if "states" not in self.episode.sensors or not len(self.episode.running):
            raise S2C2AError(
                f"'{self.label}' has no true states of a run, so there is nothing to "
                "draw. Record the sensor `states` while a strategy runs."
            )
        counted = self._counted
        if counted.shape != self.times.shape or counted.dtype != bool:
            raise S2C2AError(
                f"'{self.label}': counted has shape {counted.shape} and type "
                f"{counted.dtype}; expected booleans of shape {self.times.shape}"
            )

    @cached_property
    def times(self) -> Series:
        """Times of the steps [s]."""
        return self.episode["time"][self._rows]

    @cached_property
    def states(self) -> States:
        """End position [m] and end axis of every module."""
        return self.episode.sensor("states")[self._rows]

    @cached_property
    def desired_positions(self) -> Goals:
        """Desired positions of the module ends [m], or NaN."""
        return self._column("desired_positions", self.episode.arm.module_count, 3)

    @cached_property
    def desired_axes(self) -> Goals:
        """Desired end axes of the modules, unit vectors, or NaN."""
        return self._column("desired_axes", self.episode.arm.module_count, 3)

    @cached_property
    def obstacles(self) -> Obstacles:
        """Rows of obstacles (`s2c2a.obstacles`).

        One is absent where a value is NaN or the threshold is not positive.
        """
        return rows_of(self._column("obstacles", 0, 4))

    @property
    def _rows(self) -> np.ndarray:
        """Rows of the readings after each action, or before if the last is missing."""
        running = self.episode.running
        return running + (running[-1] + 1 < len(self.episode))

    def _column(self, name: str, *shape: int) -> np.ndarray:
        """An episode column over the run; NaN of the given shape if it is missing."""
        if self.episode.get(name) is None:
            return np.full((len(self.times), *shape), np.nan)
        return self.episode.ran(name)

    @property
    def followed_module(self) -> int:
        """Index of the outermost module with a desired position; the last if none."""
        return _outermost_module(self.desired_positions)

    @property
    def pointing_module(self) -> int:
        """Index of the outermost module with a desired axis; the last if none."""
        return _outermost_module(self.desired_axes)

    @property
    def followed_path(self) -> Points:
        """Positions of the followed module's end [m]."""
        return self.states[:, self.followed_module, POSITION]

    @property
    def desired_path(self) -> Points:
        """Desired positions of the followed module's end [m], or NaN."""
        return self.desired_positions[:, self.followed_module]

    @cached_property
    def predicted_path(self) -> Points:
        """Positions of the followed end that the plans lead to [m], or NaN."""
        predicted = self._column("predicted", self.episode.arm.module_count, 6)
        return predicted[:, self.followed_module, POSITION]

    @cached_property
    def predictive_std(self) -> Series:
        """Predictive standard deviation of the followed end [m], or NaN."""
        deviations = self._column("predictive_std", self.episode.arm.module_count)
        return deviations[:, self.followed_module]

    @cached_property
    def horizon(self) -> Float[np.ndarray, "time moments 3"]:
        """Positions of the tip that the plan leads to in the next moments [m], or NaN."""
        return self._column("horizon", 0, 3)

    @property
    def band(self) -> Series:
        """Twice the predictive standard deviation of the followed end [m], or NaN."""
        return STDS * self.predictive_std

    @property
    def has_band(self) -> bool:
        """Whether the model predicts an uncertainty."""
        return bool(np.nanmax(self.band, initial=0.0) > 0.0)

    @cached_property
    def plan_texts(self) -> tuple[str, ...]:
        """That the plan of a step does not get nearer to its goal; mostly empty."""
        from s2c2a.evaluation import describe_step_plan  # noqa: PLC0415  # heavy

        columns = {name: self._column(name) for name in ("outcome", "plan_error")}
        return tuple(
            describe_step_plan({name: column[step] for name, column in columns.items()})
            for step in range(len(self.times))
        )

    def drawn_obstacles(self) -> list[tuple[Obstacles, str]]:
        """Obstacles of the whole run for a still drawing, each with a note of its time.

        An obstacle is drawn where it first stands. One that moves is drawn where it
        last stands, too. The note is empty for one that stands from the start.
        """
        drawn = []
        for places in np.swapaxes(self.obstacles, 0, 1):
            steps = np.flatnonzero(standing(places))
            if not steps.size:
                continue
            first, last = steps[0], steps[-1]
            note = f"from {self.times[first]:.1f} s" if first else ""
            drawn.append((places[first], note))
            if (places[first] != places[last]).any():
                drawn.append((places[last], f"at {self.times[last]:.1f} s"))
        return drawn

    def standing(self, step: int) -> Obstacles:
        """Rows of the obstacles that are present at a step."""
        obstacles = self.obstacles[step]
        return obstacles[standing(obstacles)]

    @property
    def position_errors(self) -> Series:
        """Distance of the followed end from its desired position [m], or NaN."""
        return np.linalg.norm(self.followed_path - self.desired_path, axis=-1)

    @property
    def _counted(self) -> Bool[np.ndarray, " time"]:
        return np.ones(len(self.times), bool) if self.counted is None else self.counted

    @property
    def counted_errors(self) -> Float[np.ndarray, " counted"]:
        """Position errors [m] at the counted steps that have a desired position."""
        errors = self.position_errors
        return errors[self._counted & np.isfinite(errors)]

    @property
    def uncounted_spans(self) -> list[tuple[float, float]]:
        """Start and end of uncounted steps [s], half a step wider on each side."""
        times = self.times
        middles = (times[1:] + times[:-1]) / 2
        edges = np.concatenate([times[:1], middles, times[-1:]])
        padded = np.concatenate([[True], self._counted, [True]])
        changes = np.flatnonzero(np.diff(padded.astype(int)))
        return [(start, end) for start, end in edges[changes].reshape(-1, 2).tolist()]

    @property
    def axis_errors(self) -> Series:
        """Angle from the pointing module's desired axis [rad], or NaN."""
        actual = self.states[:, self.pointing_module, AXIS]
        desired = self.desired_axes[:, self.pointing_module]
        sine = np.linalg.norm(np.cross(actual, desired), axis=-1)
        return np.arctan2(sine, np.sum(actual * desired, axis=-1))


def standing(obstacles: Obstacles) -> np.ndarray:
    """Mask of the obstacles that are present: finite, with a positive threshold."""
    return np.isfinite(obstacles).all(axis=-1) & (obstacles[..., THRESHOLD] > 0)


def modules_with_goal(desired: Goals) -> Int[np.ndarray, " goals"]:
    """Indices of the modules with a finite desired vector at any time."""
    return np.flatnonzero(np.isfinite(desired).all(axis=-1).any(axis=0))


def _outermost_module(desired: np.ndarray) -> int:
    """Last module with a goal, or the last of all if none has a goal."""
    modules = modules_with_goal(desired)
    return int(modules[-1]) if modules.size else desired.shape[1] - 1


def check_same_arm(traces: Collection[Trace], arm: ArmSpec) -> None:
    """Check that there is a trace and that all have as many modules as the arm.

    Raises:
        S2C2AError: there is no trace, or one does not fit the arm.
    """
    if not traces:
        raise S2C2AError("there is no trace to draw; give at least one")
    for trace in traces:
        count = trace.episode.arm.module_count
        if count != arm.module_count:
            raise S2C2AError(
                f"trace '{trace.label}' has {counted(count, 'module')} and arm "
                f"'{arm.name}' has {arm.module_count}; draw it with the arm that it "
                "was recorded on"
            )
