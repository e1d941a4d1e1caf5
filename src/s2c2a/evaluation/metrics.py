"""Metrics of a run, one value a control step, and the scores of tasks.

docs/results/protocol.md defines the metrics, the steps that count, and their summaries.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import body_radii
from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError, TargetError, counted, did_you_mean
from s2c2a.obstacles import CENTER, CORE, THRESHOLD, distances, rows_of
from s2c2a.spaces import AXIS, POSITION
from s2c2a.tasks import Score, Task

# the protocol (docs/results/protocol.md)
LAST_STEPS = 10  # whose mean is the end distance
REACH_THRESHOLDS = {"paper": 5.0}  # cm of end distance, by recipe
DEFAULT_REACH_THRESHOLD = 3.0  # cm, of all other recipes
FAR_CLEARANCE = 0.08  # m; an obstacle with more clearance is far

States = Float[np.ndarray, "steps modules 6"]
Desired = Float[np.ndarray, "steps modules 3"]
PerStep = Float[np.ndarray, " steps"]
Vectors = Float[np.ndarray, "steps 3"]
ObstacleRows = Float[np.ndarray, "steps obstacles columns"]
StepMetric = Callable[[Episode, Task, Score], PerStep]


def position_errors(states: States, desired: Desired, module: int = -1) -> PerStep:
    """`position` [cm]: distance of a module's end to its target; NaN without target."""
    ends = states[:, module, POSITION]
    return 100.0 * np.linalg.norm(ends - desired[:, module], axis=-1)


def tilts_deg(axes: Vectors) -> PerStep:
    """Angles between axes and the vertical [deg]."""
    lateral = np.linalg.norm(axes[:, :2], axis=-1)
    return np.rad2deg(np.arctan2(lateral, axes[:, 2]))


def tilt_errors_deg(states: States, desired: Desired, module: int = -1) -> PerStep:
    """`tilt` [deg]: error of the end axis' angle to the vertical.

    The paper's "orientation error (z)".
    """
    true = tilts_deg(states[:, module, AXIS])
    return np.abs(true - tilts_deg(desired[:, module]))


def azimuth_errors_deg(states: States, desired: Desired, module: int = -1) -> PerStep:
    """`azimuth` [deg]: error of the end axis' direction in the x-y plane.

    The paper's "orientation error (x)".
    """
    difference = _azimuths(states[:, module, AXIS]) - _azimuths(desired[:, module])
    wrapped = (difference + np.pi) % (2 * np.pi) - np.pi
    return np.abs(np.rad2deg(wrapped))


def _azimuths(axes: Vectors) -> PerStep:
    return np.arctan2(axes[:, 1], axes[:, 0])


def orientation_errors_deg(
    states: States, desired: Desired, module: int = -1
) -> PerStep:
    """`orientation` [deg]: angle between desired and true end axis."""
    return angles_deg(states[:, module, AXIS], desired[:, module])


def angles_deg(
    first: Float[np.ndarray, "*batch 3"], second: Float[np.ndarray, "*batch 3"]
) -> np.ndarray:
    """Angles between vectors of any length, such as configurations [deg]."""
    cosine = np.sum(first * second, axis=-1)
    sine = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.rad2deg(np.arctan2(sine, cosine))


def clearances(
    points: Float[np.ndarray, "steps *points 3"],
    obstacles: ObstacleRows,
    radii: Float[np.ndarray, " points"] | float = 0.0,
) -> PerStep:
    """`clearance` [cm]: least distance to an obstacle's core, less its threshold r.

    Args:
        points: points of the arm in each step [m], shape (steps, ..., 3).
        obstacles: rows (`s2c2a.obstacles`), or centers and thresholds alone [m]; one
            with a threshold of zero is absent.
        radii: of the body around the points [m]; one for all, or for each of the last axis.

    Returns:
        One value a step; infinite in steps without obstacles.
    """
    least = np.full(len(points), np.inf)
    steps = (len(points), *(1,) * (points.ndim - 2))
    for rows in np.moveaxis(rows_of(obstacles), 1, 0):
        row = rows.reshape(*steps, -1)
        gaps = distances(points, row[..., CENTER], row[..., CORE])
        clear = gaps - row[..., THRESHOLD] - radii
        nearest = clear.reshape(len(points), -1).min(axis=1)
        least = np.where(rows[:, THRESHOLD] > 0, np.minimum(least, nearest), least)
    return 100.0 * least


def body_clearances(
    points: Float[np.ndarray, "steps *moments points 3"],
    obstacles: ObstacleRows,
    arm: ArmSpec,
) -> PerStep:
    """`clearances` of evenly spaced points of the arm, the tip last, with its body."""
    radii = [module.radius for module in arm.modules]
    lengths = [module.length for module in arm.modules]
    count = points.shape[-2] // len(radii)
    return clearances(points, obstacles, body_radii(lengths, radii, count))


def curve_distances(
    points: Float[np.ndarray, "*points 3"], curve: Float[np.ndarray, "knots 3"]
) -> Float[np.ndarray, "*points"]:
    """Distances of points from the nearest point of a curve [m].

    Args:
        points: of the arm [m].
        curve: successive points, with straight lines between them [m].
    """
    starts, sides = curve[:-1], np.diff(curve, axis=0)
    offsets = points[..., None, :] - starts
    shares = np.vecdot(offsets, sides) / np.maximum(np.vecdot(sides, sides), 1e-12)
    nearest = np.clip(shares, 0.0, 1.0)[..., None] * sides
    return np.linalg.norm(offsets - nearest, axis=-1).min(axis=-1)


def step_lengths(tips: Vectors) -> PerStep:
    """Displacements of the tip since the last step that has one [cm].

    Zero in the first such step; NaN where the tip is not known.
    """
    is_known = np.isfinite(tips).all(axis=-1)
    known = tips[is_known]
    lengths = np.full(len(tips), np.nan)
    lengths[is_known] = np.linalg.norm(
        np.diff(known, axis=0, prepend=known[:1]), axis=-1
    )
    return 100.0 * lengths


def tip_drifts(tips: Vectors, obstacles: ObstacleRows, far_clearance: float) -> PerStep:
    """`stillness` [cm]: distance of the tip from where it was when obstacles got far.

    NaN in steps with an obstacle that is not far.

    Args:
        tips: tip positions [m].
        obstacles: rows (`s2c2a.obstacles`).
        far_clearance: clearance above which an obstacle is far [m].
    """
    far = clearances(tips[:, None], obstacles) > 100.0 * far_clearance
    far_before = np.concatenate([[False], far[:-1]])
    begins = np.where(far & ~far_before, np.arange(len(tips)), 0)
    latest_begin = np.maximum.accumulate(begins)
    drifts = 100.0 * np.linalg.norm(tips - tips[latest_begin], axis=-1)
    return np.where(far, drifts, np.nan)


def _of_counting(reduce: Callable[[PerStep], float]) -> Callable[[PerStep], float]:
    """Aggregate the steps that count; NaN without any, as where the tip is lost."""

    def aggregate(values: PerStep) -> float:
        counting = values[~np.isnan(values)]
        return reduce(counting) if len(counting) else np.nan

    return aggregate


_mean = _of_counting(np.mean)
_minimum = _of_counting(np.min)
_maximum = _of_counting(np.max)
_sum = _of_counting(np.sum)
spread = _of_counting(np.std)
"""Standard deviation of the steps that count."""


def _last_mean(values: PerStep) -> float:
    return _mean(values[-LAST_STEPS:])


@dataclass(frozen=True)
class Metric:
    """Metric of the protocol.

    Attributes:
        unit: of its values.
        per_step: (episode, task, score) -> one value for every control step, after its
            action; NaN where the step does not count.
        aggregate: values of the steps that count -> the run's value.
    """

    unit: str
    per_step: StepMetric
    aggregate: Callable[[PerStep], float] = _mean


@dataclass(frozen=True)
class ScoreResult:
    """Result of one score of one run.

    Attributes:
        score: definition of the score.
        unit: of the values.
        values: one for every control step, NaN where the step does not count.
        value: the run's value.
        averaged: whether `value` is the mean of `values`, so that their spread has a
            meaning.
    """

    score: Score
    unit: str
    values: PerStep = field(repr=False)
    value: float
    averaged: bool


def score_run(episode: Episode, task: Task, recipe: str = "best") -> list[ScoreResult]:
    """Evaluate the scores of a task for one run.

    Args:
        episode: recorded run.
        task: task of the run.
        recipe: name of the recipe; it sets the threshold of `reached`.

    Raises:
        S2C2AError: the episode lacks true states, or has another number of steps than
            the task.
    """
    if "states" not in episode.sensors:
        raise S2C2AError(
            "the episode has no true states (`states`), which scores need; "
            "run the task on a robot that provides them"
        )
    steps = len(episode.after("states"))
    if steps != len(task.goals):
        raise S2C2AError(
            f"the episode has {counted(steps, 'step')}; task '{task.name}' has "
            f"{len(task.goals)}; score a whole run of this task"
        )
    return [_score(episode, task, score, recipe) for score in task.scores]


def check_scores(task: Task, arm: ArmSpec) -> None:
    """Check before a run that the scores of a task can be evaluated.

    Raises:
        TargetError: a score names no metric or module, or `steps` has another length
            than the task.
    """
    for score in task.scores:
        if score.metric not in METRICS:
            raise TargetError(
                f"task '{task.name}' has the unknown metric '{score.metric}'"
                f"{did_you_mean(score.metric, METRICS)}; "
                f"choose one of {', '.join(METRICS)}"
            )
        if not -arm.module_count <= score.module < arm.module_count:
            raise TargetError(
                f"task '{task.name}' scores module {score.module}; "
                f"'{arm.name}' has {counted(arm.module_count, 'module')}"
            )
        if score.steps is not None and np.shape(score.steps) != (len(task.goals),):
            raise TargetError(
                f"task '{task.name}' has {counted(len(task.goals), 'step')}; `steps` "
                f"of its score '{score.metric}' has shape {np.shape(score.steps)}"
            )


def _score(episode: Episode, task: Task, score: Score, recipe: str) -> ScoreResult:
    metric = METRICS[score.metric]
    values = metric.per_step(episode, task, score)
    # `recovery` uses the score's steps itself
    if score.steps is not None and score.metric != "recovery":
        values = np.where(score.steps, values, np.nan)
    value = float(metric.aggregate(values))
    if score.metric == "reached":
        value = float(value <= REACH_THRESHOLDS.get(recipe, DEFAULT_REACH_THRESHOLD))
    return ScoreResult(score, metric.unit, values, value, metric.aggregate is _mean)


def _compare_states(
    errors: Callable[[States, Desired, int], PerStep],
    desired: Callable[[Task], Desired],
) -> StepMetric:
    """Metric that compares true states with desired positions or axes of a task."""
    return lambda episode, task, score: errors(
        episode.after("states"), desired(task), score.module
    )


def _clearance_of_tip(points: Callable[[Episode], np.ndarray]) -> StepMetric:
    """Metric of the clearance of the tip, with the body around it."""
    return lambda episode, task, _: clearances(
        points(episode), task.obstacles(), episode.arm.modules[-1].radius
    )


def _clearance_of_arm(episode: Episode, task: Task, _: Score) -> PerStep:
    return body_clearances(_arm_points(episode), task.obstacles(), episode.arm)


def _tips(episode: Episode) -> Vectors:
    return episode.after("states")[:, -1, POSITION]


def _arm_points(episode: Episode) -> Float[np.ndarray, "steps moments points 3"]:
    """Points along the arm [m], the tip last.

    The true center line, also between control steps, where the robot provides it; else
    the modules' ends at control steps.
    """
    if "center_line" in episode.sensors:
        return episode.after("center_line")
    return episode.after("states")[:, None, :, POSITION]


def _tip_path(episode: Episode) -> Float[np.ndarray, "steps moments 3"]:
    return _arm_points(episode)[:, :, -1]


def _recovery(episode: Episode, task: Task, score: Score) -> PerStep:
    """`recovery` [s]: time from the target's last re-entry until the error stays small.

    The score's steps are those whose target is within reach. The last step has the time,
    infinite if the last error is not small; NaN before, or if the target never re-enters.
    """
    errors = position_errors(episode.after("states"), task.desired_positions())
    reachable = np.ones(len(errors), bool) if score.steps is None else score.steps
    entries = np.flatnonzero(reachable[1:] & ~reachable[:-1]) + 1
    values = np.full(len(errors), np.nan)
    if len(entries):
        large = np.flatnonzero(errors[entries[-1] :] > DEFAULT_REACH_THRESHOLD)
        steps = large[-1] + 1 if len(large) else 0
        is_small = entries[-1] + steps < len(errors)
        period = float(np.diff(episode.times()[:2])[0])
        values[-1] = period * steps if is_small else np.inf
    return values


def _stillness(episode: Episode, task: Task, _: Score) -> PerStep:
    return tip_drifts(_tips(episode), task.obstacles(), FAR_CLEARANCE)


def _shape(episode: Episode, task: Task, _: Score) -> PerStep:
    """`shape` [cm]: mean distance of the center line from the curve at control steps."""
    points = _arm_points(episode)[:, -1]
    curve = np.full((2, 3), np.nan) if task.curve is None else task.curve
    return 100.0 * curve_distances(points, curve).mean(axis=-1)


_position = _compare_states(position_errors, Task.desired_positions)

METRICS = {
    "position": Metric("cm", _position),
    "constraint": Metric("cm", _position),
    "tilt": Metric("deg", _compare_states(tilt_errors_deg, Task.desired_axes)),
    "azimuth": Metric("deg", _compare_states(azimuth_errors_deg, Task.desired_axes)),
    "orientation": Metric(
        "deg", _compare_states(orientation_errors_deg, Task.desired_axes)
    ),
    "end distance": Metric("cm", _position, _last_mean),
    "reached": Metric("of runs", _position, _last_mean),
    "clearance": Metric("cm", _clearance_of_tip(_tip_path), _minimum),
    "clearance at steps": Metric("cm", _clearance_of_tip(_tips), _minimum),
    "clearance of the arm": Metric("cm", _clearance_of_arm, _minimum),
    "path length": Metric("cm", lambda run, *_: step_lengths(_tips(run)), _sum),
    "shape": Metric("cm", _shape, _last_mean),
    "stillness": Metric("cm", _stillness, _maximum),
    "recovery": Metric("s", _recovery, lambda values: values[-1]),
}
"""Metrics by name (docs/results/protocol.md)."""
