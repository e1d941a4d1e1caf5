"""The tables of the benchmark: one line an entrant."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import get_args

import numpy as np
from jaxtyping import Float

from s2c2a.evaluation.report import save_csv
from s2c2a.files.text import write_atomically
from s2c2a_experiments.benchmark.cells import Cell, Result
from s2c2a_experiments.benchmark.entrants import Entrant
from s2c2a_experiments.benchmark.figure import planners_figure
from s2c2a_experiments.benchmark.protocol import TASKS
from s2c2a_experiments.benchmark.result_files import save_results
from s2c2a_experiments.benchmark.scores import Metric, keeps_clear
from s2c2a_experiments.table_files import (
    markdown_escaped,
    markdown_table,
)

HELD_OUT = "held out"
OBSTACLES = "obstacles"
DIGITS = 9  # of success, beyond which differences are rounding errors


@dataclass(frozen=True)
class PlannerComparison:
    """All results of a benchmark.

    Attributes:
        entrants: that took part.
        results: of cells that were run.
        dashes: the other cells.
        seeds: of data, training and start.
    """

    entrants: Sequence[Entrant]
    results: Sequence[Result]
    dashes: Sequence[Cell]
    seeds: Sequence[int]

    @property
    def tasks(self) -> list[str]:
        """Names of the tasks, in the order of the protocol."""
        names = {cell.task.name for cell in self.cells}
        return [name for name in TASKS if name in names]

    @property
    def common_tasks(self) -> list[str]:
        """Names of the tasks that every entrant does; of those with payload, the unknown."""
        cells = [cell for cell in self.cells if not cell.knows_payload]
        names = [cell.task.name for cell in cells if not cell.task.needs]
        return list(dict.fromkeys(names))

    @property
    def cells(self) -> list[Cell]:
        """Those that were run, and the others."""
        return [*(result.cell for result in self.results), *self.dashes]

    def arms(self, held_out: bool) -> list[str]:
        """Names of the arms held out, or of the others."""
        names = [
            cell.arm.arm.name
            for cell in self.cells
            if (cell.arm.group == HELD_OUT) == held_out
        ]
        return list(dict.fromkeys(names))

    def success(self, entrant: str, arms: Sequence[str]) -> Float[np.ndarray, " seeds"]:
        """Success of every seed, the mean over arms and tasks; NaN if it does none.

        An arm or a task that the entrant does not do counts as no success. A known
        payload counts where nothing else was run: it is a task with more information.
        """
        names = [cell.task.name for cell in self.cells if not cell.knows_payload]
        none = np.zeros(len(self.seeds))
        shares = dict.fromkeys(product(arms, names or self.tasks), none)
        done = {
            (arm, task): _by_seed(result.metrics["success"], len(self.seeds))
            for result in self.results
            for name, task, arm in (result.cell.names,)
            if name == entrant and (arm, task) in shares
        }
        if not done:
            return np.full(len(self.seeds), np.nan)
        return np.mean([*(shares | done).values()], axis=0)

    @property
    def main_arms(self) -> list[str]:
        """Names of the arms that are not held out, if there are some."""
        return self.arms(held_out=False) or self.arms(held_out=True)

    def values(self, entrant: str, tasks: Sequence[str], metric: Metric) -> np.ndarray:
        """A metric of the runs of an entrant with the main arms, where they have it.

        Args:
            entrant: its name.
            tasks: names of tasks.
            metric: its name.
        """
        arms = self.main_arms
        values: list[float] = []
        for result in self.results:
            name, task, arm = result.cell.names
            if name == entrant and task in tasks and arm in arms:
                values += result.metrics.get(metric, [])
        return np.array(values, float)

    def settling(self, entrant: str) -> float:
        """Median settling time past obstacles [s]; infinite if half the runs failed."""
        runs = len(self.values(entrant, [OBSTACLES], "success"))
        if not runs:
            return np.nan
        times = self.values(entrant, [OBSTACLES], "settling")
        failed = np.full(runs - len(times), np.inf)
        return float(np.median([*times, *failed]))

    def step_times(self, entrant: str) -> tuple[float, float] | None:
        """Median over tasks and main arms of the median and of 99 % [ms]; None without."""
        arms = self.main_arms
        steps = []
        for result in self.results:
            name, _, arm = result.cell.names
            if name == entrant and arm in arms and result.step:
                steps.append(result.step)
        if not steps:
            return None
        median, slow = np.median(steps, axis=0)
        return float(median), float(slow)


HEADER_END = (
    "path length",
    "jerk",
    "settling [s]",
    "step, median; 99 % [ms]",
    "data",
    "lines",
)


def header(comparison: PlannerComparison) -> list[str]:
    """Names of the columns of `lines`."""
    return ["entrant", "family", "success", "held out", *comparison.tasks, *HEADER_END]


def lines(comparison: PlannerComparison) -> list[list[str]]:
    """The cells of one line an entrant, the most successful first."""
    return [_line(comparison, entrant) for entrant in ranked(comparison)]


def ranked(comparison: PlannerComparison) -> list[Entrant]:
    """The entrants, the most successful first; of equal ones, that of the least error."""
    arms = comparison.main_arms

    def place(entrant: Entrant) -> tuple[float, float]:
        success = comparison.success(entrant.name, arms).mean()
        errors = comparison.values(entrant.name, comparison.tasks, "error")
        error = errors.mean() if len(errors) else np.inf
        return -round(np.nan_to_num(success), DIGITS), error

    return sorted(comparison.entrants, key=place)


def arm_table(comparison: PlannerComparison) -> tuple[list[str], list[list[str]]]:
    """Header and lines of the table of success by arm; the arms held out come last."""
    arms = comparison.arms(held_out=False) + comparison.arms(held_out=True)
    body = []
    for entrant in ranked(comparison):
        shares = [comparison.success(entrant.name, [arm]).mean() for arm in arms]
        body.append([f"`{entrant.name}`", *map(_percent, shares)])
    return ["entrant", *arms], body


def _line(comparison: PlannerComparison, entrant: Entrant) -> list[str]:
    name = entrant.name
    tasks = [_task_cell(comparison, name, task) for task in comparison.tasks]
    step = comparison.step_times(name)
    times = "; ".join(f"{time:.1f}" for time in step) if step else "-"
    common = comparison.common_tasks
    lengths = comparison.values(name, common, "path length")
    jerks = comparison.values(name, common, "jerk")
    settling = comparison.settling(name)
    groups = map(comparison.arms, (False, True))
    shares = [comparison.success(name, arms) for arms in groups]
    return [
        f"`{name}`",
        entrant.family,
        *map(_with_spread, shares),
        *tasks,
        _mean(lengths, 2),
        _mean(jerks, 1),
        f"{settling:.1f}" if np.isfinite(settling) else "-",
        times,
        str(entrant.samples or "-"),
        str(entrant.lines),
    ]


def _task_cell(comparison: PlannerComparison, name: str, task: str) -> str:
    success = comparison.values(name, [task], "success")
    if not len(success):
        return "-"
    errors = comparison.values(name, [task], "error")
    parts = [_percent(success.mean()), _mean(errors, 1)]
    if task == OBSTACLES:
        clearances = comparison.values(name, [task], "clearance")
        touching = [not keeps_clear([clearance]) for clearance in clearances]
        parts.append(_percent(float(np.mean(touching))) if touching else "-")
    elif "axes" in TASKS[task].needs:
        parts.append(_mean(comparison.values(name, [task], "axis error"), 1))
    return "; ".join(parts)


def _by_seed(values: Sequence[float], seeds: int) -> Float[np.ndarray, " seeds"]:
    """Means over the scenes of every seed; `jobs_for` has all scenes of a seed in a row."""
    return np.reshape(values, (seeds, -1)).mean(axis=1)


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if np.isfinite(share) else "-"


def _with_spread(shares: Float[np.ndarray, " seeds"]) -> str:
    """Mean and standard deviation between seeds."""
    mean = shares.mean()
    if len(shares) < 2 or not np.isfinite(mean):
        return _percent(mean)
    return f"{100 * mean:.0f} ± {100 * shares.std(ddof=1):.0f} %"


def _mean(values: np.ndarray, digits: int) -> str:
    if not len(values):
        return "-"
    return f"{values.mean():.{digits}f}"


def dash_lines(comparison: PlannerComparison) -> list[str]:
    """Why entrants do not take part, a sentence a reason."""
    texts = []
    for entrant in comparison.entrants:
        places: dict[str, list[Cell]] = {}
        for cell in comparison.dashes:
            if cell.entrant.name == entrant.name:
                places.setdefault(cell.dash, []).append(cell)
        for reason, cells in places.items():
            tasks = dict.fromkeys(cell.task.name for cell in cells)
            arms = dict.fromkeys(cell.arm.arm.name for cell in cells)
            texts.append(
                f"`{entrant.name}` {reason}: {', '.join(tasks)} with {', '.join(arms)}"
            )
    return texts


def failure_lines(comparison: PlannerComparison) -> list[str]:
    """Errors that ended runs, each once an entrant, arm and task."""
    texts = []
    for result in comparison.results:
        name, task, arm = result.cell.names
        for message in result.failures:
            texts.append(f"`{name}` with {arm}, {task}: {message}")
    return list(dict.fromkeys(texts))


CELLS = ("entrant", "task", "arm", "group", "runs", "failed", *get_args(Metric))
"""Columns of `cell_rows`."""


def cell_rows(comparison: PlannerComparison) -> list[list[str]]:
    """An entrant on a task with an arm a row: numbers of runs, and means of metrics."""
    rows = []
    for result in comparison.results:
        metrics = result.metrics
        means = [
            f"{np.mean(metrics[name]):.4g}" if metrics.get(name) else ""
            for name in get_args(Metric)
        ]
        runs = str(len(metrics["success"]))
        failed = str(len(result.failures))
        cell = result.cell
        rows.append([*cell.names, cell.arm.group, runs, failed, *means])
    return rows


def write_tables(comparison: PlannerComparison, folder: Path) -> Path:
    """Write the tables, `planners.json` and `cells.csv`; return the first, Markdown."""
    save_results(comparison.results, comparison.seeds, folder / "planners.json")
    head = header(comparison)
    body = lines(comparison)
    save_csv(head, body, folder / "planners.csv")
    by_arm = arm_table(comparison)
    save_csv(*by_arm, folder / "by-arm.csv")
    save_csv(CELLS, cell_rows(comparison), folder / "cells.csv")
    reasons = dash_lines(comparison) + failure_lines(comparison)
    notes = "\n".join(f"- {markdown_escaped(text)}" for text in reasons)
    table = markdown_table(head, body)
    arms = markdown_table(*by_arm)
    return write_atomically(f"{table}\n{arms}\n{notes}\n", folder / "planners.md")


def draw(comparison: PlannerComparison, path: Path) -> Path:
    """Draw the profiles of errors, and success over time of a step."""
    own = [entrant.name for entrant in comparison.entrants if entrant.is_own]
    names = [entrant.name for entrant in ranked(comparison)]
    errors = {}
    points = {}
    for name in names:
        errors[name] = comparison.values(name, comparison.tasks, "error")
        step = comparison.step_times(name)
        success = float(comparison.success(name, comparison.main_arms).mean())
        if step and np.isfinite(success):
            points[name] = step[0], success
    runs = max(
        len(comparison.values(name, comparison.tasks, "success")) for name in names
    )
    partial = [
        entrant.name
        for entrant in comparison.entrants
        if entrant.arms and not set(comparison.main_arms) <= set(entrant.arms)
    ]
    return planners_figure(errors, runs, points, path, own, partial)
