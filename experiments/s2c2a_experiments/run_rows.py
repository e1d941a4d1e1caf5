"""Rows of runs beside their scores: predictions of the forward model, computing time."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from s2c2a.evaluation import Row, position_errors
from s2c2a.jobs import Heading, Run
from s2c2a.spaces import POSITION

PREDICTION = (
    ("model error", "cm"),
    ("predictive std", "cm"),
    ("errors within twice the std", "of steps"),
)
"""Metrics of `prediction_rows` and their units."""


def labeled(rows: Iterable[Row], label: str) -> list[Row]:
    """Rows with a label in place of the strategy, without the numbers of the paper."""
    return [
        replace(row, strategy=label, paper_mean=None, paper_std=None) for row in rows
    ]


def errors_of(run: Run) -> Float[np.ndarray, " steps"]:
    """Position errors of a run [cm] (`evaluation.position_errors`)."""
    states = run.episode.after("states")
    return position_errors(states, run.job.task.desired_positions())


def metric_rows(
    experiment: str,
    runs: Sequence[Run],
    label: str,
    metrics: Mapping[tuple[str, str], Sequence[float]],
    task: str = "",
) -> list[Row]:
    """Make a row of every metric of one task's runs.

    Args:
        experiment: its name.
        runs: under one set of conditions, one for each seed.
        label: in place of the strategy.
        metrics: name and unit -> a value for each run.
        task: in place of the runs' task.
    """
    heading = Heading.of(experiment, runs)
    return [
        heading.row(
            task or runs[0].task, label, *names, [float(value) for value in values]
        )
        for names, values in metrics.items()
    ]


def prediction_rows(experiment: str, runs: Sequence[Run]) -> list[Row]:
    """Make rows of the error of the forward model, and of its standard deviation.

    Args:
        experiment: its name.
        runs: under one set of conditions, with all seeds; those without predictions
            have no rows. A model without uncertainty has a standard deviation of zero.
    """
    heading = Heading.of(experiment, runs)
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        if np.any(run.episode.columns.get("predictive_std", 0.0)):
            groups.setdefault((run.task, run.strategy), []).append(run)
    rows = []
    for (task, strategy), group in groups.items():
        columns = zip(*(_prediction(run) for run in group), strict=True)
        for (metric, unit), values in zip(PREDICTION, columns, strict=True):
            rows.append(heading.row(task, strategy, metric, unit, values))
    return rows


def _prediction(run: Run) -> tuple[float, float, float]:
    """Mean model error [cm], mean standard deviation [cm], share within twice that."""
    episode = run.episode
    states = episode.after("states")[:, -1, POSITION]
    predicted = episode.ran("predicted")[:, -1, POSITION]
    errors = 100.0 * np.linalg.norm(states - predicted, axis=-1)
    std = 100.0 * episode.ran("predictive_std")[:, -1]
    within = float(np.mean(errors <= 2.0 * std))
    return float(errors.mean()), float(std.mean()), within


def tick_rows(experiment: str, runs: Sequence[Run]) -> list[Row]:
    """Make rows of the time of control steps [ms] for each strategy, over all its runs.

    Args:
        experiment: its name.
        runs: of one arm.
    """
    heading = Heading.of(experiment, runs)
    ticks: dict[str, list[np.ndarray]] = {}
    for run in runs:
        ticks.setdefault(run.strategy, []).append(1e3 * run.episode.ran("tick_time"))
    rows = []
    for strategy, arrays in ticks.items():
        median, high = np.percentile(np.concatenate(arrays), (50, 99))
        for metric, value in (
            ("tick, median", median),
            ("tick, 99th percentile", high),
        ):
            rows.append(heading.row("all", strategy, metric, "ms", [float(value)]))
    return rows
