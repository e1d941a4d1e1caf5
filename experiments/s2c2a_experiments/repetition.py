"""Repetition: how well a slow camera corrects the model, within a run and over runs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from s2c2a import jobs
from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode
from s2c2a.evaluation import Row, position_errors
from s2c2a.strategies import recipe_named
from s2c2a.tasks import Task, circle
from s2c2a.tasks.circle import ROUND_TIME
from s2c2a_experiments.run_rows import errors_of, metric_rows
from s2c2a_experiments.sensors import Case, last_quarter, with_sensors

EXPERIMENT = "repetition"
SENSORS = "camera"
ENCODERS = "encoders"


@dataclass(frozen=True)
class RepetitionStudy:
    """What is repeated.

    Attributes:
        arms: without sensors; a camera is added.
        tasks: names.
        repetitions: of each task.
        seeds: of data, training and start.
        turns: of the circle in one run, with and without the camera; none if zero.
    """

    arms: tuple[ArmSpec, ...]
    tasks: tuple[str, ...] = ("circle",)
    repetitions: int = 5
    seeds: tuple[int, ...] = (0,)
    turns: int = 3


def repetition_rows(study: RepetitionStudy, make: jobs.Make) -> list[Row]:
    """Errors of every repetition, for every arm and task, and of every turn of a run.

    Args:
        study: what is repeated.
        make: finds or makes runs, networks and recordings.
    """
    groups = [_jobs(study, arm, task) for arm in study.arms for task in study.tasks]
    rows = []
    for runs in jobs.in_groups(make, groups):
        rows += rows_of(runs)
    if study.turns:
        rows += _turn_rows(study, make)
    return rows


def _turn_rows(study: RepetitionStudy, make: jobs.Make) -> list[Row]:
    """Mean error of every turn of the circle in one run."""
    cases = list(product(study.arms, (ENCODERS, SENSORS)))
    groups = [
        Case(arm, sensors, 0.0).make_jobs([turning(arm, study.turns)], study.seeds)
        for arm, sensors in cases
    ]
    rows = []
    for (_, sensors), runs in zip(cases, jobs.in_groups(make, groups), strict=True):
        errors = np.array([_turn_errors(run, study.turns) for run in runs])
        for number, values in enumerate(errors.T, start=1):
            label = f"{sensors}, turn {number}"
            metrics = {("position", "cm"): values.tolist()}
            rows += metric_rows(EXPERIMENT, runs, label, metrics)
    return rows


def turning(arm: ArmSpec, turns: int) -> Task:
    """The task circle with several turns."""
    once = circle(arm)
    start = len(once.goals) - round(ROUND_TIME * arm.control_rate)
    goals = once.goals[:start] + turns * once.goals[start:]
    return replace(once, name=f"circle-{turns}-turns", goals=goals)


def _turn_errors(run: jobs.Run, turns: int) -> list[float]:
    """Mean distance of the tip from its target in every turn [cm]."""
    steps = turns * round(ROUND_TIME * run.job.arm.control_rate)
    parts = np.split(errors_of(run)[-steps:], turns)
    return [float(np.nanmean(turn)) for turn in parts]


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
    rows = []
    late = last_quarter(runs[0])
    for number in range(runs[0].job.repetitions):
        metrics = {
            ("position", "cm"): [_mean_error(run, number, 0) for run in runs],
            ("position, last quarter", "cm"): [
                _mean_error(run, number, late) for run in runs
            ],
        }
        label = f"{SENSORS}, repetition {number + 1}"
        rows += metric_rows(EXPERIMENT, runs, label, metrics)
    return rows


def _mean_error(run: jobs.Run, repetition: int, first: int) -> float:
    """Mean distance of the tip from its target, from a step on [cm]."""
    episodes: tuple[Episode, ...] = (*run.earlier, run.episode)
    states = episodes[repetition].after("states")
    errors = position_errors(states, run.job.task.desired_positions())
    return float(np.nanmean(errors[first:]))
