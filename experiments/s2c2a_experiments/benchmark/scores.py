"""The metrics of a run: success, error, clearance, path length, jerk, settling."""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float

from s2c2a.evaluation import ScoreResult
from s2c2a.jobs import Run
from s2c2a.spaces import POSITION
from s2c2a.tasks import Task

# of the protocol
POSITION_BOUND = 5.0  # % of the arm's length: 3 cm of 60 cm, as the paper's arm about
ANGLE_BOUND = 10.0  # deg
STRICTNESS = (0.5, 1.0, 2.0)  # times both bounds; one bound alone would rank by chance
TOUCH = 0.35  # % of the arm's length: a touch, by the simulation's contact
STILL = 1e-6  # m; a goal that moves less in the whole run is still
POSITIONS = ("position", "constraint", "end distance")
ANGLES = ("tilt", "orientation", "azimuth")
CLEARANCES = ("clearance of the arm",)
Metric = Literal[
    "success", "error", "axis error", "clearance", "path length", "jerk", "settling"
]
"""Share of the bounds that a run keeps; error and clearance [% of length]; error of the
axis [deg]; path length [of the shortest]; jerk [log]; settling time [s]."""
Metrics = dict[Metric, float]
"""Of a run; NaN where it has none."""
Points = Float[np.ndarray, "points 3"]
Tips = Float[np.ndarray, "steps 3"]


def metrics_of(run: Run) -> Metrics:
    """All metrics of a run that was made to its end."""
    arm = run.job.arm
    scores = {result.score.metric: result for result in run.scores}
    scale = 1.0 / arm.length  # cm of m are %
    errors = _parts(scores, POSITIONS, scale)
    angles = _parts(scores, ANGLES, 1.0)
    clearances = _parts(scores, CLEARANCES, scale)
    tips = run.episode.after("states")[:, -1, POSITION]
    starts = run.episode.ran("sensor.states")[:, -1, POSITION]
    is_clear = keeps_clear(clearances)
    return {
        "success": success_of(errors, angles) if is_clear else 0.0,
        "error": max(errors, default=np.nan),
        "axis error": max(angles, default=np.nan),
        "clearance": min(clearances, default=np.nan),
        "path length": path_length_ratio(starts[:1], tips, run.job.task),
        "jerk": log_jerk(tips, arm.control_period),
        "settling": settling_time(run, is_clear),
    }


def _parts(
    scores: Mapping[str, ScoreResult], names: tuple[str, ...], scale: float
) -> list[float]:
    return [scale * scores[name].value for name in names if name in scores]


def keeps_clear(clearances: Sequence[float]) -> bool:
    """Whether clearances [% of length] show no touch, which NaN does not."""
    return all(value >= -TOUCH for value in clearances)


def success_of(errors: list[float], angles: list[float]) -> float:
    """Share of the bounds that hold all values, which NaN is never within."""
    held = [
        all(value <= factor * POSITION_BOUND for value in errors)
        and all(value <= factor * ANGLE_BOUND for value in angles)
        for factor in STRICTNESS
    ]
    return float(np.mean(held))


def path_length_ratio(start: Points, tips: Tips, task: Task) -> float:
    """Path length of the tip over that of its goals, both from where the tip was."""
    goals = task.desired_positions()[:, -1]
    is_known = np.isfinite(goals).all(axis=-1)
    if not is_known.any():
        return np.nan
    shortest = _path_length(np.concatenate([start, goals[is_known]]))
    if shortest == 0.0:
        return np.nan
    return _path_length(np.concatenate([start, tips])) / shortest


def _path_length(points: Points) -> float:
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=-1)
    return float(lengths.sum())


def log_jerk(tips: Tips, period: float) -> float:
    """Log dimensionless jerk of the tip; larger is less smooth.

    ln(T^3 / v_max^2 * integral of the squared jerk) (Balasubramanian et al., IEEE
    Trans. Biomedical Engineering 59, 2012, without its sign).
    """
    if len(tips) < 4:
        return np.nan
    steps = np.linalg.norm(np.diff(tips, axis=0), axis=-1)
    speed = steps.max() / period
    if not speed > 0:
        return np.nan
    jerk = np.diff(tips, n=3, axis=0) / period**3
    squares = jerk**2
    integral = float(squares.sum()) * period
    duration = len(tips) * period
    unit = duration**3 / speed**2
    return float(np.log(unit * integral))


def settling_time(run: Run, is_clear: bool) -> float:
    """Time after which the tip stays within the bound of a still target [s].

    The whole run where it does not, or where the arm touches an obstacle; NaN where the
    target moves.
    """
    goals = run.job.task.desired_positions()[:, -1]
    ranges = np.ptp(goals, axis=0)
    if not np.isfinite(goals).all() or ranges.max() > STILL:
        return np.nan
    arm = run.job.arm
    tips = run.episode.after("states")[:, -1, POSITION]
    distances = np.linalg.norm(tips - goals, axis=-1)
    errors = distances / arm.length
    is_outside = (errors > POSITION_BOUND / 100.0) | (not is_clear)
    if not is_outside.any():
        return 0.0
    outside = np.flatnonzero(is_outside)
    steps = outside[-1] + 1
    return float(steps * arm.control_period)
