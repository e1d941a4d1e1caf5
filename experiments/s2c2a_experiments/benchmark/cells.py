"""The cells of the benchmark: an entrant on a task with an arm, once a seed."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float

from s2c2a import jobs
from s2c2a.errors import S2C2AError, counted
from s2c2a.estimation import EstimationSettings
from s2c2a.execution.versions import versions
from s2c2a.planning import Guard
from s2c2a.strategies import RunOptions
from s2c2a.tasks import Task
from s2c2a_experiments.benchmark.entrants import Entrant
from s2c2a_experiments.benchmark.protocol import BenchmarkArm, BenchmarkTask
from s2c2a_experiments.benchmark.scores import Metric, Metrics, metrics_of

FAILED: Metrics = {"success": 0.0}
"""The metrics of a run that an error ended."""


@dataclass(frozen=True)
class Cell:
    """An entrant on a task with an arm.

    Attributes:
        entrant: that plans.
        task: of the protocol.
        arm: of the protocol.
    """

    entrant: Entrant
    task: BenchmarkTask
    arm: BenchmarkArm

    @property
    def names(self) -> tuple[str, str, str]:
        """Of entrant, task and arm."""
        return self.entrant.name, self.task.name, self.arm.arm.name

    @property
    def dash(self) -> str:
        """Why there is nothing to run; empty if there is."""
        entrant = self.entrant
        arm = self.arm.arm
        ignored = self.task.needs.intersection(entrant.options.ignores)
        if ignored and not entrant.is_baseline:
            names = " and ".join(sorted(ignored))
            return f"ignores {names}"
        if self.knows_payload and not entrant.takes_payload:
            return "has no place for a known payload"
        if len(arm.modules) < self.task.modules:
            return f"is given no arm of {counted(self.task.modules, 'module')}"
        if entrant.arms and arm.name not in entrant.arms:
            names = " and ".join(entrant.arms)
            return f"was trained for {names} alone"
        return ""

    @property
    def knows_payload(self) -> bool:
        """Whether the entrant is given the payload."""
        return self.task.condition == "payload known"

    @property
    def guard(self) -> Guard:
        """What keeps clear of obstacles: the whole arm where the entrant can."""
        has_obstacles = "obstacles" in self.task.needs
        if has_obstacles and "guard" in self.entrant.options.supports:
            return "arm"
        return "tip"

    def make_jobs(self, tasks: Sequence[Task], seeds: Sequence[int]) -> list[jobs.Job]:
        """The runs of these tasks, once a seed."""
        conditions = self.task.conditions(self.arm.arm)
        robot = dict(conditions.robot.options)
        payload = 0.0
        if self.knows_payload:
            payload = float(str(robot["payload"]))
        settings = EstimationSettings(known_payload=payload)
        run = RunOptions(self.guard, settings)
        return jobs.jobs_for(
            tasks,
            self.entrant.sensed(self.arm.arm),
            [self.entrant.strategy],
            seeds,
            self.entrant.recipe,
            jobs.Conditions(conditions.robot, run, may_end_early=True),
            self.entrant.weights,
        )


@dataclass(frozen=True)
class Result:
    """What came of a cell.

    Attributes:
        cell: that was run.
        metrics: a value of every run that has one.
        failures: messages of runs that an error ended.
        step: median and 99th percentile of the times of its control steps [ms]; None
            without a step.
        versions: of the software that made it.
    """

    cell: Cell
    metrics: dict[Metric, list[float]]
    failures: tuple[str, ...]
    step: tuple[float, float] | None
    versions: dict[str, str]


def all_cells(
    entrants: Sequence[Entrant],
    tasks: Sequence[BenchmarkTask],
    arms: Sequence[BenchmarkArm],
) -> list[Cell]:
    """Every entrant on every task with every arm."""
    triples = product(entrants, arms, tasks)
    return [Cell(entrant, task, arm) for entrant, arm, task in triples]


def run_cells(
    cells: Sequence[Cell],
    seeds: Sequence[int],
    make: jobs.Make,
    saved: Iterable[Result] = (),
) -> list[Result]:
    """Results of all cells that have no dash, in their order.

    Args:
        cells: to run.
        seeds: of data, training and start.
        make: finds or makes runs, networks and recordings; an error stands in the place
            of what failed.
        saved: results that need not be made; of those of the same cell, the last counts.
    """
    results = {result.cell.names: result for result in saved}
    running = [cell for cell in cells if not cell.dash and cell.names not in results]
    tasks_of_cells = _tasks_of(running)
    groups = [
        cell.make_jobs(tasks, seeds)
        for cell, tasks in zip(running, tasks_of_cells, strict=True)
    ]
    runs = jobs.in_groups(make, groups)
    for cell, runs_of_cell in zip(running, runs, strict=True):
        metrics: dict[Metric, list[float]] = {}
        failures = []
        ticks = []
        for run in runs_of_cell:
            values = FAILED
            if isinstance(run, S2C2AError):
                failures.append(_line(str(run)))
            elif "interrupted" in run.episode.options:
                message = run.episode.options["interrupted"]
                failures.append(_line(str(message)))
            else:
                values = metrics_of(run)
                ticks.append(run.episode.ran("tick_time"))
            for name, value in values.items():
                if np.isfinite(value):
                    metrics.setdefault(name, []).append(_rounded(value))
        results[cell.names] = Result(
            cell, metrics, tuple(failures), _step_times(ticks), versions()
        )
    return [results[cell.names] for cell in cells if not cell.dash]


def _tasks_of(cells: Sequence[Cell]) -> list[list[Task]]:
    """The tasks of every cell; cells with the same arm and task share them."""
    known: dict[tuple[int, str], list[Task]] = {}
    tasks_of_cells = []
    for cell in cells:
        key = id(cell.arm), cell.task.name
        if key not in known:
            known[key] = cell.task.tasks(cell.arm)
        tasks_of_cells.append(known[key])
    return tasks_of_cells


def _step_times(
    ticks: Sequence[Float[np.ndarray, " steps"]],
) -> tuple[float, float] | None:
    """Median and 99th percentile [ms] of times of runs [s]; None without a step."""
    times = np.concatenate([np.zeros(0), *ticks])
    if not len(times):
        return None
    median, slow = 1e3 * np.percentile(times, (50, 99))
    return _rounded(median), _rounded(slow)


def _line(message: str) -> str:
    """A message as one line that terminals and tables show as it is."""
    plain = message.replace("`", "'")
    words = "".join(char if char.isprintable() else " " for char in plain).split()
    return " ".join(words)


def _rounded(value: float) -> float:
    """The value with four digits, as files keep it."""
    return float(f"{value:.4g}")
