"""Repetition: how well a slow camera corrects the model, within a run and over runs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from s2c2a import jobs
from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode
from s2c2a.evaluation import Row, position_errors
from s2c2a.strategies import recipe_named
from s2c2a_experiments.sensors import last_quarter, with_sensors

EXPERIMENT = "repetition"
SENSORS = "camera"
Errors = Sequence[float]


@dataclass(frozen=True)
class RepetitionStudy:
    """What is repeated.

    Attributes:
        arms: without sensors; a camera is added.
        tasks: names.
        repetitions: of each task.
        seeds: of data, training and start.
    """

    arms: tuple[ArmSpec, ...]
    tasks: tuple[str, ...] = ("circle",)
    repetitions: int = 5
    seeds: tuple[int, ...] = (0,)


def repetition_rows(study: RepetitionStudy, make: jobs.Make) -> list[Row]:
    """Mean and last-quarter error of every repetition, for every arm and task.

    Args:
        study: what is repeated.
        make: finds or makes runs, networks and recordings.
    """
    groups = [_jobs(study, arm, task) for arm in study.arms for task in study.tasks]
    rows = []
    for runs in jobs.in_groups(make, groups):
        rows += rows_of(runs)
    return rows


def _jobs(study: RepetitionStudy, arm: ArmSpec, task: str) -> list[jobs.Job]:
    return jobs.jobs_for(
        [task],
        with_sensors(arm, SENSORS),
        ["s2c2a"],
        study.seeds,
        recipe_named("best"),
        repetitions=study.repetitions,
    )


def rows_of(runs: Sequence[jobs.Run]) -> list[Row]:
    """Rows of the runs of one arm and task; runs differ in their seed."""
    heading = jobs.Heading.of(EXPERIMENT, runs)
    rows = []
    for number in range(runs[0].job.repetitions):
        label = f"{SENSORS}, repetition {number + 1}"
        for metric, first in (
            ("position", 0),
            ("position, last quarter", last_quarter(runs[0])),
        ):
            errors = [_mean_error(run, number, first) for run in runs]
            row = heading.row(runs[0].task, "s2c2a", metric, "cm", errors, [])
            rows.append(replace(row, strategy=label, paper_mean=None, paper_std=None))
    return rows


def _mean_error(run: jobs.Run, repetition: int, first: int) -> float:
    """Mean distance of the tip from its target, from a step on [cm]."""
    episodes: tuple[Episode, ...] = (*run.earlier, run.episode)
    states = episodes[repetition].after("states")
    errors = position_errors(states, run.job.task.desired_positions())
    return float(np.nanmean(errors[first:]))
