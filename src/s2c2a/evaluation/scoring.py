"""From a run to its scores: which metric, over which steps, summed up how."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.evaluation import metrics
from s2c2a.evaluation.rollout import Rollout
from s2c2a.spaces import POSITION
from s2c2a.tasks import Score

LAST_STEPS = 10
REACHED = {"paper": 5.0}
REACHED_OTHERWISE = 3.0
"""The mean of the last ten steps counts as reached below this [cm]; the paper's recipe is allowed more."""
FAR = 0.08  # m beyond its threshold an obstacle is far
RECOVERED = 3.0  # cm

PerStep = Float[np.ndarray, " steps"]


def _mean(values: PerStep) -> float:
    """NaN where no step counts, as on an arm that reaches none of a path."""
    counting = values[~np.isnan(values)]
    return float(counting.mean()) if len(counting) else float("nan")


@dataclass(frozen=True)
class Metric:
    """A metric of the protocol.

    Attributes:
        unit: of its values.
        of: (run, score) -> a value for every control step, NaN where none counts.
        summed_up: values of the steps that count -> one number for the run.
        averaged: whether that number is the mean over steps, so that a spread over steps has a meaning.
        rises: whether more is better.
    """

    unit: str
    of: Callable[[Rollout, Score], PerStep]
    summed_up: Callable[[PerStep], float] = _mean
    averaged: bool = True
    rises: bool = False


@dataclass(frozen=True)
class Scored:
    """One score of one run.

    Attributes:
        score: what was scored.
        unit: of the values.
        values: one for every control step, NaN where none counts.
        value: the run's number.
        averaged: whether it is the mean of the values.
    """

    score: Score
    unit: str
    values: PerStep
    value: float
    averaged: bool


def score_run(run: Rollout, recipe: str) -> list[Scored]:
    """Score a run by what its task asks for.

    Args:
        run: what happened.
        recipe: its name; the protocol lets the paper's recipe end further from a target and still count as there.
    """
    return [_scored(run, score, recipe) for score in run.task.scores]


def _scored(run: Rollout, score: Score, recipe: str) -> Scored:
    metric = METRICS[score.metric]
    values = metric.of(run, score)
    if score.steps is not None and score.metric != "recovery":
        values = np.where(score.steps, values, np.nan)
    value = metric.summed_up(values)
    if score.metric == "reached":
        value = float(value <= REACHED.get(recipe, REACHED_OTHERWISE))
    return Scored(score, metric.unit, values, value, metric.averaged)


def _of_states(function, wanted: str) -> Callable[[Rollout, Score], PerStep]:
    return lambda run, score: function(run.states, getattr(run.task, wanted)(), score.module)


def _tips(run: Rollout) -> np.ndarray:
    return run.states[:, -1, POSITION]


def _clearance(run: Rollout, score: Score) -> PerStep:
    """Of the tip, between control steps too where the run was watched."""
    points = _tips(run)[:, None] if run.centre_lines is None else run.centre_lines[:, :, -1]
    return metrics.clearances(points, run.task.obstacles())


def _clearance_at_steps(run: Rollout, score: Score) -> PerStep:
    return metrics.clearances(_tips(run)[:, None], run.task.obstacles())


def _clearance_of_arm(run: Rollout, score: Score) -> PerStep:
    """Of all module ends where the run was not watched, else of all points of the centre line."""
    points = run.states[:, :, POSITION] if run.centre_lines is None else run.centre_lines
    return metrics.clearances(points, run.task.obstacles())


def _recovery(run: Rollout, score: Score) -> PerStep:
    """The one number of the run at the last step, so that it can be shown beside the others.

    The score's steps are those whose target is within reach.
    """
    errors = metrics.position_errors(run.states, run.task.wanted_positions())
    period = float(run.times[1] - run.times[0])
    values = np.full(len(errors), np.nan)
    inside = np.ones(len(errors), bool) if score.steps is None else score.steps
    values[-1] = metrics.recovery_time(errors, inside, RECOVERED, period)
    return values


def _last_mean(values: PerStep) -> float:
    return float(np.mean(values[-LAST_STEPS:]))


def _least(values: PerStep) -> float:
    return float(np.nanmin(values))


def _largest(values: PerStep) -> float:
    return float(np.nanmax(values))


_position = _of_states(metrics.position_errors, "wanted_positions")

METRICS = {
    "position": Metric("cm", _position),
    "constraint": Metric("cm", _position),
    "tilt": Metric("deg", _of_states(metrics.tilt_errors_deg, "wanted_axes")),
    "azimuth": Metric("deg", _of_states(metrics.azimuth_errors_deg, "wanted_axes")),
    "orientation": Metric("deg", _of_states(metrics.orientation_errors_deg, "wanted_axes")),
    "end distance": Metric("cm", _position, _last_mean, averaged=False),
    "reached": Metric("of runs", _position, _last_mean, averaged=False, rises=True),
    "clearance": Metric("cm", _clearance, _least, averaged=False, rises=True),
    "clearance at steps": Metric("cm", _clearance_at_steps, _least, averaged=False, rises=True),
    "clearance of the arm": Metric("cm", _clearance_of_arm, _least, averaged=False, rises=True),
    "path length": Metric(
        "cm", lambda run, _: metrics.step_lengths(_tips(run)), lambda v: float(np.sum(v)), averaged=False
    ),
    "stillness": Metric(
        "cm", lambda run, _: metrics.stray(_tips(run), run.task.obstacles(), FAR), _largest, averaged=False
    ),
    "recovery": Metric("s", _recovery, lambda values: float(values[-1]), averaged=False),
}
"""Metrics by name (docs/protocol.md)."""
