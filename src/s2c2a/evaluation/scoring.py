"""From a run to its scores: which metric, over which steps, summed up how."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError
from s2c2a.evaluation import metrics
from s2c2a.evaluation.metrics import PerStep
from s2c2a.spaces import POSITION
from s2c2a.tasks import Score, Task

LAST_STEPS = 10
REACHED = {"paper": 5.0}
REACHED_OTHERWISE = 3.0
"""The mean of the last ten steps counts as reached below this [cm]; the paper's recipe is allowed more."""
FAR = 0.08  # m beyond its threshold an obstacle is far
RECOVERED = 3.0  # cm


def _mean(values: PerStep) -> float:
    """NaN where no step counts, as on an arm that reaches none of a path."""
    counting = values[~np.isnan(values)]
    return counting.mean() if len(counting) else np.nan


@dataclass(frozen=True)
class Outcome:
    """What came of a task, one row a control step, each after the step's action.

    Attributes:
        task: what was asked.
        times: [s], shape (steps,).
        states: true states, shape (steps, modules, 6), base frame.
        lines: true centre line between control steps too [m], shape (steps, moments, points, 3), the tip last;
            where nothing watched it the modules' ends at the steps, as one moment.
    """

    task: Task
    times: Float[np.ndarray, " steps"]
    states: Float[np.ndarray, "steps modules 6"]
    lines: Float[np.ndarray, "steps moments points 3"]

    @property
    def tips(self) -> Float[np.ndarray, "steps 3"]:
        """Where the tip was after each step [m]."""
        return self.states[:, -1, POSITION]


@dataclass(frozen=True)
class Metric:
    """A metric of the protocol.

    Attributes:
        unit: of its values.
        of: (run, score) -> a value for every control step, NaN where none counts.
        summed_up: values of the steps that count -> one number for the run.
        rises: whether more is better.
    """

    unit: str
    of: Callable[[Outcome, Score], PerStep]
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
        averaged: whether it is the mean of the values, so that their spread has a meaning.
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
        recipe: its name; the protocol lets the paper's recipe end further from a target and still count as there.

    Raises:
        S2C2AError: the episode holds no true states, or is not of as many steps as the task.
    """
    if "states" not in episode.sensors:
        raise S2C2AError("this episode holds no true states; a run needs them to be scored")
    states = episode.after("states")
    if len(states) != len(task.goals):
        raise S2C2AError(f"this episode has {len(states)} steps, and '{task.name}' has {len(task.goals)}")
    lines = episode.after("centre_line") if "centre_line" in episode.sensors else states[:, None, :, POSITION]
    outcome = Outcome(task, episode.times(), states, lines)
    return [_scored(outcome, score, recipe) for score in task.scores]


def _scored(run: Outcome, score: Score, recipe: str) -> Scored:
    metric = METRICS[score.metric]
    values = metric.of(run, score)
    if score.steps is not None and score.metric != "recovery":
        values = np.where(score.steps, values, np.nan)
    value = float(metric.summed_up(values))
    if score.metric == "reached":
        value = float(value <= REACHED.get(recipe, REACHED_OTHERWISE))
    return Scored(score, metric.unit, values, value, averaged=metric.summed_up is _mean)


def _of_states(function, wanted: str) -> Callable[[Outcome, Score], PerStep]:
    return lambda run, score: function(run.states, getattr(run.task, wanted)(), score.module)


def _clearance(points: Callable[[Outcome], np.ndarray]) -> Callable[[Outcome, Score], PerStep]:
    return lambda run, _: metrics.clearances(points(run), run.task.obstacles())


def _recovery(run: Outcome, score: Score) -> PerStep:
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
    return np.mean(values[-LAST_STEPS:])


_position = _of_states(metrics.position_errors, "wanted_positions")

METRICS = {
    "position": Metric("cm", _position),
    "constraint": Metric("cm", _position),
    "tilt": Metric("deg", _of_states(metrics.tilt_errors_deg, "wanted_axes")),
    "azimuth": Metric("deg", _of_states(metrics.azimuth_errors_deg, "wanted_axes")),
    "orientation": Metric("deg", _of_states(metrics.orientation_errors_deg, "wanted_axes")),
    "end distance": Metric("cm", _position, _last_mean),
    "reached": Metric("of runs", _position, _last_mean, rises=True),
    "clearance": Metric("cm", _clearance(lambda run: run.lines[:, :, -1]), np.nanmin, rises=True),
    "clearance at steps": Metric("cm", _clearance(lambda run: run.tips[:, None]), np.nanmin, rises=True),
    "clearance of the arm": Metric("cm", _clearance(lambda run: run.lines), np.nanmin, rises=True),
    "path length": Metric("cm", lambda run, _: metrics.step_lengths(run.tips), np.sum),
    "stillness": Metric("cm", lambda run, _: metrics.stray(run.tips, run.task.obstacles(), FAR), np.nanmax),
    "recovery": Metric("s", _recovery, lambda values: values[-1]),
}
"""Metrics by name (docs/protocol.md)."""
