"""Metrics as functions of arrays, one number for every control step, and how runs are scored (docs/protocol.md).

From a run to its scores: which metric, over which steps, summed up how.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError, TargetError
from s2c2a.spaces import AXIS, POSITION
from s2c2a.tasks import Score, Task

LAST_STEPS = 10
REACHED = {"paper": 5.0}
REACHED_OTHERWISE = 3.0
"""The mean of the last ten steps counts as reached below this [cm]; the paper's recipe
is allowed more."""
FAR = 0.08  # m beyond its threshold an obstacle is far
RECOVERED = 3.0  # cm

States = Float[np.ndarray, "steps modules 6"]
Desired = Float[np.ndarray, "steps modules 3"]
PerStep = Float[np.ndarray, " steps"]
Of = Callable[[Episode, Task, Score], PerStep]


def position_errors(states: States, desired: Desired, module: int = -1) -> PerStep:
    """`position` [cm]: distance of a module's end to its target; NaN where there is none."""
    return 100.0 * np.linalg.norm(
        states[:, module, POSITION] - desired[:, module], axis=-1
    )


def tilts_deg(axes: Float[np.ndarray, "steps 3"]) -> PerStep:
    """Angle of axes to the vertical [deg]."""
    return np.rad2deg(np.arctan2(np.linalg.norm(axes[:, :2], axis=-1), axes[:, 2]))


def tilt_errors_deg(states: States, desired: Desired, module: int = -1) -> PerStep:
    """`tilt` [deg]: error of the end axis' angle to the vertical; the paper's 'orientation error (z)'."""
    return np.abs(tilts_deg(states[:, module, AXIS]) - tilts_deg(desired[:, module]))


def azimuth_errors_deg(states: States, desired: Desired, module: int = -1) -> PerStep:
    """`azimuth` [deg]: error of the end axis' direction in the x-y plane; the paper's 'orientation error (x)'."""
    true = states[:, module, AXIS]
    asked = desired[:, module]
    turned = np.arctan2(true[:, 1], true[:, 0]) - np.arctan2(asked[:, 1], asked[:, 0])
    return np.abs(np.rad2deg((turned + np.pi) % (2 * np.pi) - np.pi))


def orientation_errors_deg(
    states: States, desired: Desired, module: int = -1
) -> PerStep:
    """`orientation` [deg]: angle between desired and true end axis."""
    return angles_deg(states[:, module, AXIS], desired[:, module])


def angles_deg(
    first: Float[np.ndarray, "*batch 3"], second: Float[np.ndarray, "*batch 3"]
) -> np.ndarray:
    """Angle between vectors, such as configurations, of any length [deg]."""
    cosine = np.sum(first * second, axis=-1)
    sine = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.rad2deg(np.arctan2(sine, cosine))


def clearances(
    points: Float[np.ndarray, "steps *points 3"],
    obstacles: Float[np.ndarray, "steps obstacles 4"],
) -> PerStep:
    """`clearance` [cm]: smallest distance of any point of a step to an obstacle's center, less its threshold r.

    Args:
        points: where the arm was in each step [m].
        obstacles: centers and thresholds [m]; one whose threshold is zero is not there,
            and none leave infinite room.
    """
    flat = points.reshape(len(points), -1, 1, 3)
    centers = obstacles[:, None, :, :3]
    thresholds = obstacles[:, None, :, 3]
    distances = np.where(
        thresholds > 0, np.linalg.norm(flat - centers, axis=-1) - thresholds, np.inf
    )
    return 100.0 * distances.min(axis=(1, 2), initial=np.inf)


def step_lengths(tips: Float[np.ndarray, "steps 3"]) -> PerStep:
    """Way of the tip [cm] in every control step but the first, which counts zero."""
    return 100.0 * np.concatenate(
        [[0.0], np.linalg.norm(np.diff(tips, axis=0), axis=-1)]
    )


def stray(
    tips: Float[np.ndarray, "steps 3"],
    obstacles: Float[np.ndarray, "steps obstacles 4"],
    far: float,
) -> PerStep:
    """`stillness` [cm]: how far the tip is from where it was when every obstacle last came to be far; NaN while near.

    Args:
        tips: tip positions [m].
        obstacles: centers and thresholds [m].
        far: how much more than its threshold an obstacle is away when it is far [m].
    """
    away = clearances(tips[:, None], obstacles) > 100.0 * far
    begins = np.where(
        away & ~np.concatenate([[False], away[:-1]]), np.arange(len(tips)), 0
    )
    since = np.maximum.accumulate(begins)
    return np.where(away, 100.0 * np.linalg.norm(tips - tips[since], axis=-1), np.nan)


def recovery_time(
    errors: PerStep, inside: Bool[np.ndarray, " steps"], near: float, period: float
) -> float:
    """`recovery` [s]: time from the target's last re-entry until the error stays below `near` [cm] to the end.

    NaN where the target never left, infinite where the error does not stay below.
    """
    entries = np.flatnonzero(inside[1:] & ~inside[:-1]) + 1
    if not len(entries):
        return float("nan")
    apart = np.flatnonzero(errors[entries[-1] :] > near)
    if len(apart) and apart[-1] == len(errors) - entries[-1] - 1:
        return float("inf")
    return period * (apart[-1] + 1 if len(apart) else 0)


def _mean(values: PerStep) -> float:
    """NaN where no step counts, as on an arm that reaches none of a path."""
    counting = values[~np.isnan(values)]
    return counting.mean() if len(counting) else np.nan


@dataclass(frozen=True)
class Metric:
    """A metric of the protocol.

    Attributes:
        unit: of its values.
        of: (episode, task, score) -> a value for every control step after its action,
            NaN where none counts.
        summed_up: values of the steps that count -> one number for the run.
        rises: whether more is better.
    """

    unit: str
    of: Of
    summed_up: Callable[[PerStep], float] = _mean
    rises: bool = False


@dataclass(frozen=True)
class Scored:
    """One score of one run.

    Attributes:
        score: what was scored.
        unit: of the values.
        values: one for every control step, NaN where none counts.
        value: the run's number.
        averaged: whether it is the mean of the values, so that their spread has a
            meaning.
    """

    score: Score
    unit: str
    values: PerStep
    value: float
    averaged: bool


def score_run(episode: Episode, task: Task, recipe: str) -> list[Scored]:
    """Score a run by what its task asks for.

    Args:
        episode: what happened.
        task: what was asked.
        recipe: its name; the protocol lets the paper's recipe end further from a target
            and still count as there.

    Raises:
        S2C2AError: the episode holds no true states, or is not of as many steps as the
            task.
    """
    if "states" not in episode.sensors:
        raise S2C2AError(
            "this episode holds no true states; a run needs them to be scored"
        )
    steps = len(episode.after("states"))
    if steps != len(task.goals):
        raise S2C2AError(
            f"this episode has {steps} steps, and '{task.name}' has {len(task.goals)}"
        )
    return [_scored(episode, task, score, recipe) for score in task.scores]


def check_scores(task: Task, arm: ArmSpec) -> None:
    """Refuse a task that cannot be scored, before anything moves for it.

    Raises:
        TargetError: no such metric or module, or not a truth for every step.
    """
    for score in task.scores:
        if score.metric not in METRICS:
            raise TargetError(
                f"'{task.name}' has the score '{score.metric}'; take one of {', '.join(METRICS)}"
            )
        if not -arm.module_count <= score.module < arm.module_count:
            raise TargetError(
                f"'{task.name}' scores module {score.module}; '{arm.name}' has {arm.module_count}"
            )
        if score.steps is not None and np.shape(score.steps) != (len(task.goals),):
            raise TargetError(
                f"'{task.name}' counts {np.shape(score.steps)} steps, and has {len(task.goals)}"
            )


def _scored(episode: Episode, task: Task, score: Score, recipe: str) -> Scored:
    metric = METRICS[score.metric]
    values = metric.of(episode, task, score)
    if score.steps is not None and score.metric != "recovery":
        values = np.where(score.steps, values, np.nan)
    value = float(metric.summed_up(values))
    if score.metric == "reached":
        value = float(value <= REACHED.get(recipe, REACHED_OTHERWISE))
    return Scored(score, metric.unit, values, value, averaged=metric.summed_up is _mean)


def _of_states(function, desired: str) -> Of:
    return lambda episode, task, score: function(
        episode.after("states"), getattr(task, desired)(), score.module
    )


def _clearance(points: Callable[[Episode], np.ndarray]) -> Of:
    return lambda episode, task, _: clearances(points(episode), task.obstacles())


def _tips(episode: Episode) -> Float[np.ndarray, "steps 3"]:
    return episode.after("states")[:, -1, POSITION]


def _lines(episode: Episode) -> Float[np.ndarray, "steps moments points 3"]:
    """The true center line between control steps too, the tip last; else the modules' ends, as one moment [m]."""
    watched = "center_line" in episode.sensors
    return (
        episode.after("center_line")
        if watched
        else episode.after("states")[:, None, :, POSITION]
    )


def _recovery(episode: Episode, task: Task, score: Score) -> PerStep:
    """The one number of the run at the last step, so that it can be shown beside the others.

    The score's steps are those whose target is within reach.
    """
    errors = position_errors(episode.after("states"), task.desired_positions())
    period = float(np.diff(episode.times()[:2])[0])
    values = np.full(len(errors), np.nan)
    inside = np.ones(len(errors), bool) if score.steps is None else score.steps
    values[-1] = recovery_time(errors, inside, RECOVERED, period)
    return values


def _stillness(episode: Episode, task: Task, _: Score) -> PerStep:
    return stray(_tips(episode), task.obstacles(), FAR)


def _last_mean(values: PerStep) -> float:
    return np.mean(values[-LAST_STEPS:])


_position = _of_states(position_errors, "desired_positions")

METRICS = {
    "position": Metric("cm", _position),
    "constraint": Metric("cm", _position),
    "tilt": Metric("deg", _of_states(tilt_errors_deg, "desired_axes")),
    "azimuth": Metric("deg", _of_states(azimuth_errors_deg, "desired_axes")),
    "orientation": Metric("deg", _of_states(orientation_errors_deg, "desired_axes")),
    "end distance": Metric("cm", _position, _last_mean),
    "reached": Metric("of runs", _position, _last_mean, rises=True),
    "clearance": Metric(
        "cm",
        _clearance(lambda episode: _lines(episode)[:, :, -1]),
        np.nanmin,
        rises=True,
    ),
    "clearance at steps": Metric(
        "cm", _clearance(lambda episode: _tips(episode)[:, None]), np.nanmin, rises=True
    ),
    "clearance of the arm": Metric("cm", _clearance(_lines), np.nanmin, rises=True),
    "path length": Metric(
        "cm", lambda episode, *_: step_lengths(_tips(episode)), np.sum
    ),
    "stillness": Metric("cm", _stillness, np.nanmax),
    "recovery": Metric("s", _recovery, lambda values: values[-1]),
}
"""Metrics by name (docs/protocol.md)."""
