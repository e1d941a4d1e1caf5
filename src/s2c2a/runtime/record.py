"""Records of control steps, and the episode that a sequence of them makes."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode
from s2c2a.episodes.episode import SENSOR, sensor_shapes
from s2c2a.errors import RecordingError
from s2c2a.goals import Goal
from s2c2a.obstacles import CORE
from s2c2a.plugins.immutable import immutable, immutable_table, rebuilt
from s2c2a.printing import short_text
from s2c2a.runtime.alignment import align_states
from s2c2a.spaces import Actions, Reading, Stage

OWN_COLUMNS = {
    "time",
    "stage",
    "actions",
    "tick_time",
    "desired_positions",
    "desired_axes",
    "obstacles",
}
"""Columns that the loop fills, beside those of the sensors."""


@dataclass(frozen=True)
class StepRecord:
    """Record of one control step, which nothing can change.

    Attributes:
        number: of the step, from zero.
        moment: when the step began, on the loop's clock [s].
        stage: stage of the arm in the step.
        reading: reading before the action.
        goal: requested goal; used while the arm runs.
        action: action that was really sent [m or N], shape (modules, cables).
        diagnostics: telemetry of the controller, by column of an episode.
        tick_time: time that the controller took to choose the action [s].
        late: delay of the step's beginning [s].
        fault: what is wrong; empty if nothing is.
    """

    number: int
    moment: float
    stage: Stage
    reading: Reading
    goal: Goal | None
    action: Actions
    diagnostics: Mapping[str, np.ndarray] = field(default_factory=dict)
    tick_time: float = 0.0
    late: float = 0.0
    fault: str = ""

    __repr__ = short_text

    def __post_init__(self):
        """Copy what others may change later."""
        object.__setattr__(self, "reading", replace(self.reading))
        object.__setattr__(self, "action", immutable(np.asarray(self.action)))
        object.__setattr__(self, "diagnostics", immutable_table(self.diagnostics))

    def __reduce__(self):
        """Support pickling, since records travel between processes."""
        return rebuilt(self)


def build_episode(steps: Sequence[StepRecord], arm: ArmSpec, **options: Any) -> Episode:
    """Build an episode with one row a step, states at the times of the readings.

    See `build_piece`.
    """
    return with_aligned_states(build_piece(steps, arm, **options))


def with_aligned_states(episode: Episode) -> Episode:
    """The episode with the states of a tracker moved to the times of the readings."""
    columns = dict(episode.columns)
    # move states of a tracker, if there are any, to the times of the readings
    states = columns.get(SENSOR + "states")
    ages = columns.get(SENSOR + "states_age")
    if states is not None and ages is not None:
        columns[SENSOR + "states"] = align_states(columns["time"], states, ages)
    return replace(episode, columns=columns)


def build_piece(steps: Sequence[StepRecord], arm: ArmSpec, **options: Any) -> Episode:
    """Build a piece of an episode, with the states of a tracker as they arrived.

    Every sensor and every diagnostic that occurs in any step becomes a column. What a
    sensor returned in another shape than that of `Reading` is NaN.

    Args:
        steps: records of at least one step.
        arm: arm that was controlled.
        options: how the episode was made.

    Raises:
        RecordingError: there is no step.
    """
    if not steps:
        raise RecordingError("no control step was done, so there is no episode to save")
    columns = {
        "time": _times(steps),
        "stage": np.array([step.stage for step in steps], np.int8),
        "actions": np.array([step.action for step in steps]),
        "tick_time": np.array([step.tick_time for step in steps]),
    }
    sensors = _table([step.reading.sensors for step in steps], sensor_shapes(arm))
    columns |= {f"{SENSOR}{name}": column for name, column in sensors.items()}
    columns |= _table([step.diagnostics for step in steps], {})
    columns |= _goal_columns(steps, Goal.of(arm.module_count))
    faults = sorted({step.fault for step in steps if step.fault})
    if faults:
        options["faults"] = faults
    return Episode(arm, columns, options)


def _times(steps: Sequence[StepRecord]) -> np.ndarray:
    """Times of readings [s]; where one is invalid, the loop's clock continues them."""
    times: list[float] = []
    for number, step in enumerate(steps):
        time = step.reading.time
        if not times:
            time = time if np.isfinite(time) else 0.0
        elif not np.isfinite(time) or time <= times[-1]:
            elapsed = max(step.moment - steps[number - 1].moment, 0.0)
            time = np.nextafter(times[-1] + elapsed, np.inf)
        times.append(time)
    return np.array(times)


def _table(
    rows: Sequence[Mapping[str, np.ndarray]], shapes: Mapping[str, tuple[int, ...]]
) -> dict[str, np.ndarray]:
    """Columns of all names that occur in any row; some have a known shape of a row."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {
        name: _column([row.get(name) for row in rows], shapes.get(name))
        for name in names
    }


def _column(
    values: Sequence[np.ndarray | None], shape: tuple[int, ...] | None
) -> np.ndarray:
    """One row a step; NaN where a step has no numbers of the shape.

    Without a known shape, it is the most common one.
    """
    arrays = [_array(value) for value in values]
    if shape is None:
        numeric = [array for array in arrays if _is_numeric(array)]
        shapes = Counter(array.shape for array in numeric or arrays)
        shape = shapes.most_common(1)[0][0]
    rows = [np.full(shape, np.nan)] * len(arrays)
    for number, array in enumerate(arrays):
        if _is_numeric(array) and array.shape == shape:
            rows[number] = array
    return np.array(rows)


def _array(value: Any) -> np.ndarray:
    """The value as an array; None where it is none, such as lists of several lengths."""
    try:
        return np.asarray(value)
    except (TypeError, ValueError):
        return np.asarray(None)


def _is_numeric(array: np.ndarray) -> bool:
    return array.dtype.kind in "fiub"  # float, integer, or boolean; None is an object


def _goal_columns(steps: Sequence[StepRecord], nothing: Goal) -> dict[str, np.ndarray]:
    """Columns of the goals: only those in which any goal is set.

    Where the arm neither runs nor holds, there is none.
    """
    goals = []
    for step in steps:
        is_active = step.stage in (Stage.RUN, Stage.HOLD)
        goals.append(step.goal if is_active and step.goal else nothing)
    stacked = Goal.stacked(goals)
    obstacles = stacked.obstacles_in_use()
    if not obstacles[..., CORE].any():  # all are spheres
        obstacles = obstacles[..., : CORE.start]
    columns = {
        "desired_positions": stacked.desired_positions(),
        "desired_axes": stacked.desired_axes(),
        "obstacles": obstacles,
    }
    return {
        name: values
        for name, values in columns.items()
        if values.size and np.isfinite(values).any()
    }
