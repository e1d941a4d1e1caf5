"""What is known after a control step, and from the steps of a loop to an episode."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode
from s2c2a.episodes.episode import SENSOR
from s2c2a.errors import RecordingError
from s2c2a.goals import Goal
from s2c2a.spaces import Actions, Reading, Stage


@dataclass(frozen=True)
class Step:
    """What is known after one control step.

    Attributes:
        number: of the step, from zero.
        moment: when it began, on the loop's clock [s].
        stage: what the arm did.
        reading: before the action.
        goal: that was asked for, if the arm ran or held.
        action: as really sent [m or N].
        diagnostics: by what drives it, by column.
        tick_time: sense, plan and act together [s].
        late: how much too late it began [s].
        fault: what was wrong, in words.
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


def episode_of(steps: Sequence[Step], arm: ArmSpec, **options: Any) -> Episode:
    """What happened, one row a step; a column for what every step, or every running one, has to say.

    Args:
        steps: at least one.
        arm: that was driven.
        options: how it came about.

    Raises:
        RecordingError: no step.
    """
    if not steps:
        raise RecordingError("nothing happened, so there is no episode to keep")
    columns = {
        "time": _times(steps),
        "stage": np.array([step.stage for step in steps], np.int8),
        "actions": np.array([step.action for step in steps]),
        "tick_time": np.array([step.tick_time for step in steps]),
    }
    for name in dict.fromkeys(name for step in steps for name in step.reading.sensors):
        columns[SENSOR + name] = _filled([step.reading.get(name) for step in steps])
    for name in dict.fromkeys(name for step in steps for name in step.diagnostics):
        columns[name] = _filled([step.diagnostics.get(name) for step in steps])
    faults = sorted({step.fault for step in steps if step.fault})
    said = options | ({"faults": faults} if faults else {})
    return Episode(arm, columns | _asked([_goal(step, arm) for step in steps]), said)


def _goal(step: Step, arm: ArmSpec) -> Goal:
    """What the step aimed at; nothing while it was led to rest."""
    return (
        step.goal
        if step.goal is not None and step.stage in (Stage.RUN, Stage.HOLD)
        else Goal.of(arm.module_count)
    )


def _times(steps: Sequence[Step]) -> np.ndarray:
    """Of the readings; the loop's clock goes on from there where one says none, or one that has been."""
    times: list[float] = []
    for number, step in enumerate(steps):
        time = step.reading.time
        if not np.isfinite(time) or (times and time <= times[-1]):
            passed = step.moment - steps[number - 1].moment if number else 0.0
            time = np.nextafter(times[-1] + max(passed, 0.0), np.inf) if times else 0.0
        times.append(time)
    return np.array(times)


def _filled(values: Sequence[np.ndarray | None]) -> np.ndarray:
    """One row a step; NaN where a step has none, or one of another shape than most."""
    arrays = [None if value is None else np.asarray(value) for value in values]
    shapes = Counter(
        array.shape
        for array in arrays
        if array is not None and array.dtype.kind in "fiub"
    )
    nothing = np.full(shapes.most_common(1)[0][0] if shapes else (), np.nan)
    sound = [
        array is not None
        and array.dtype.kind in "fiub"
        and array.shape == nothing.shape
        for array in arrays
    ]
    return np.array(
        [array if good else nothing for array, good in zip(arrays, sound, strict=True)]
    )


def _asked(goals: Sequence[Goal]) -> dict[str, np.ndarray]:
    """Columns of what was asked: only those in which anything was."""
    every = Goal.stacked(goals)
    columns = {
        "desired_positions": every.desired_positions(),
        "desired_axes": every.desired_axes(),
        "obstacles": every.obstacles_in_use(),
    }
    return {
        name: values
        for name, values in columns.items()
        if values.size and np.isfinite(values).any()
    }
