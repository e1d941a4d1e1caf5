"""Tuning: the same number of trials for every entrant, on an arm that is in no table."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path

import numpy as np

from s2c2a import jobs
from s2c2a.errors import S2C2AError
from s2c2a.execution.progress import Progress
from s2c2a.files.text import write_atomically
from s2c2a.jobs.execution import in_groups, try_all
from s2c2a.tasks import Task
from s2c2a_experiments.benchmark.entrants import Entrant
from s2c2a_experiments.benchmark.protocol import TASKS, VERSION, tuning_arm
from s2c2a_experiments.benchmark.search_space import Values, range_from, value_at

TRIALS = 10  # of every entrant; the first one is the entrant as it is
TUNED_BY = ("path", "moving target")
"""Tasks whose mean error of the position is made small."""


def tune(
    entrants: Sequence[Entrant],
    cache: jobs.Cache,
    executor: Executor | None,
    progress: Progress,
    keep: Callable[[dict], object] = lambda values: None,
) -> dict[str, Values]:
    """Tuned values by entrant and place; an interrupted tuning continues.

    Args:
        entrants: as their files have them.
        cache: where recordings, networks and runs are kept.
        executor: trains and runs; this process if None.
        progress: called with a label, the number done and the total.
        keep: called with all values so far after every entrant.

    Raises:
        S2C2AError: all trials of an entrant failed.
    """

    def make(artifacts):
        return try_all(artifacts, cache, executor, progress)

    found: dict[str, Values] = {}
    for entrant in entrants:
        trials = drawn_trials(entrant)
        groups = [_jobs(entrant.with_values(values)) for values in trials]
        best = np.inf
        for values, runs in zip(trials, in_groups(make, groups), strict=True):
            failure = next((run for run in runs if isinstance(run, S2C2AError)), None)
            if failure is not None:
                continue
            errors = [
                scored.value
                for run in runs
                for scored in run.scores
                if scored.score.metric == "position"
            ]
            error = float(np.mean(errors))
            if error < best:
                best = error
                found[entrant.name] = values
        if entrant.name not in found:
            raise S2C2AError(
                f"all {TRIALS} trials of '{entrant.name}' failed, such as: {failure}"
            )
        keep(found)
    return found


def drawn_trials(entrant: Entrant) -> list[Values]:
    """Values by place: those of the entrant, then random ones, the same in every call."""
    ranges = [range_from(text) for text in entrant.tuned]
    start = {
        each.place: value_at(entrant.recipe, each.place, entrant.strategy)
        for each in ranges
    }
    generator = np.random.default_rng(0)
    trials = [start]
    while len(trials) < TRIALS:
        drawn = {
            each.place: each.drawn(start[each.place], generator) for each in ranges
        }
        trials.append(drawn)
    return trials


def described(entrant: Entrant) -> list[str]:
    """What the trials of an entrant depend on: places, and the runs of the first one."""
    return [*entrant.tuned, *(job.file for job in _jobs(entrant))]


def _jobs(entrant: Entrant) -> list[jobs.Job]:
    """The runs that score an entrant."""
    chosen = tuning_arm()
    tasks: list[Task] = []
    for name in TUNED_BY:
        tasks += TASKS[name].tasks(chosen)
    conditions = TASKS[TUNED_BY[0]].conditions(chosen.arm)
    conditions = replace(conditions, may_end_early=False)
    arm = entrant.sensed(chosen.arm)
    return jobs.jobs_for(
        tasks, arm, (entrant.strategy,), (0,), entrant.recipe, conditions
    )


def write_values(values: dict[str, Values], path: Path) -> Path:
    """Write tuned values as `entrants.TUNED` holds them."""
    lines = [
        f"# Of {TRIALS} trials each on {tuning_arm().arm.name}, protocol version {VERSION}.",
        "[values]",
    ]
    for name, places in values.items():
        lines.append(f"\n[values.{name}]")
        for place, value in places.items():
            lines.append(f'"{place}" = {value:.4g}')
    text = "\n".join(lines)
    return write_atomically(f"{text}\n", path)
