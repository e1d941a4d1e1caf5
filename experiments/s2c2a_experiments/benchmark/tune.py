"""Tuning: the same number of trials for every entrant, on an arm that is in no table."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path

from s2c2a import jobs
from s2c2a.errors import S2C2AError
from s2c2a.execution.progress import Progress
from s2c2a.files.text import write_atomically
from s2c2a.tasks import Task
from s2c2a_experiments.benchmark.entrants import Entrant
from s2c2a_experiments.benchmark.protocol import TASKS, VERSION, tuning_arm
from s2c2a_experiments.search_space import Value, value_at, varied_from
from s2c2a_experiments.sweep import Sweep, best_of, search

TRIALS = 10  # of every entrant; the first one is the entrant as it is
TUNED_BY = ("path", "moving target")
"""Tasks whose mean error of the position is made small."""


def tune(
    entrants: Sequence[Entrant],
    folder: Path,
    cache: jobs.Cache,
    executor: Executor | None,
    progress: Progress,
    keep: Callable[[dict], object] = lambda values: None,
) -> dict[str, dict[str, Value]]:
    """Tuned values by entrant and place; an interrupted tuning continues.

    Args:
        entrants: as their files have them.
        folder: keeps the trials.
        cache: where recordings, networks and runs are kept.
        executor: trains and runs; this process if None.
        progress: called with a label, the number done and the total.
        keep: called with all values so far after every entrant.

    Raises:
        S2C2AError: all trials of an entrant failed.
    """
    found: dict[str, dict[str, Value]] = {}
    for entrant in entrants:
        sweep = _sweep(entrant)
        trials = search(sweep, TRIALS, folder / entrant.name, cache, executor, progress)
        found[entrant.name] = best_of(trials).values
        keep(found)
    return found


def described(entrant: Entrant) -> list[str]:
    """What the trials of an entrant depend on: places, and the runs of the first one."""
    first = _sweep(entrant).jobs()
    return [*entrant.tuned, *(job.file for job in first)]


def _sweep(entrant: Entrant) -> Sweep:
    """The sweep of an entrant.

    Raises:
        S2C2AError: the entrant as it is lies outside its ranges.
    """
    chosen = tuning_arm()
    tasks: list[Task] = []
    for name in TUNED_BY:
        tasks += TASKS[name].tasks(chosen)
    conditions = TASKS[TUNED_BY[0]].conditions(chosen.arm)
    varied = varied_from(entrant.tuned, entrant.recipe, entrant.strategy)
    for each in varied:
        if not each.holds(value_at(entrant.recipe, each.place, entrant.strategy)):
            raise S2C2AError(
                f"'{entrant.name}' as it is lies outside of {each.place}: widen its range"
            )
    return Sweep(
        arm=entrant.sensed(chosen.arm),
        tasks=tuple(tasks),
        recipe=entrant.recipe,
        varied=varied,
        conditions=replace(conditions, may_end_early=False),
        strategy=entrant.strategy,
    )


def write_values(values: dict[str, dict[str, Value]], path: Path) -> Path:
    """Write tuned values as `entrants.TUNED` holds them."""
    lines = [
        f"# Of {TRIALS} trials each on {tuning_arm().arm.name}, protocol version {VERSION}.",
        "[values]",
    ]
    for name, places in values.items():
        lines.append(f"\n[values.{name}]")
        for place, value in places.items():
            lines.append(f'"{place}" = {_toml(value)}')
    text = "\n".join(lines)
    return write_atomically(f"{text}\n", path)


def _toml(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.4g}"
