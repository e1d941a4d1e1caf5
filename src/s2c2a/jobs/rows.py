"""From runs and trainings to rows, over seeds."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.jobs.job import Run
from s2c2a.jobs.paper import printed
from s2c2a.robots.simulation.modes import first_mode
from s2c2a.strategies import TrainedNetworks


@dataclass(frozen=True)
class Heading:
    """What rows of one arm share.

    Attributes:
        experiment: what they belong to.
        arm: the arm.
        recipe: its name.
        seeds: of data, training and start.
        fidelity: of the simulation.
    """

    experiment: str
    arm: ArmSpec
    recipe: str
    seeds: tuple[int, ...]
    fidelity: str = "fast"

    @classmethod
    def of(cls, experiment: str, runs: Sequence[Run]) -> "Heading":
        """That of one arm's runs under one set of conditions."""
        job = runs[0].job
        seeds = tuple(dict.fromkeys(run.seed for run in runs))
        return cls(experiment, job.arm, job.recipe.name, seeds, job.conditions.fidelity)

    @cached_property
    def modes(self) -> dict[str, Any]:
        """The arm's first mode: a stiffer or slower arm makes every task easy."""
        return dict(zip(("first_mode_hz", "damping_ratio"), first_mode(self.arm), strict=True))

    def row(
        self,
        task: str,
        strategy: str,
        metric: str,
        unit: str,
        values: Sequence[float],
        spreads: Sequence[float] = (),
        **more: Any,
    ) -> Row:
        """A row of one value a seed, and of spreads over the steps of a run; what the paper printed is beside it."""
        more = over_seeds(values, spreads) | {"seeds": self.seeds} | printed(task, self.arm, strategy, metric) | more
        return Row(self.experiment, task, self.arm.name, self.fidelity, strategy, self.recipe, metric, unit, **more)


def score_rows(experiment: str, runs: Sequence[Run]) -> list[Row]:
    """One row for every task, strategy and metric of one arm's runs, its first mode beside it."""
    heading, rows = Heading.of(experiment, runs), []
    for task, strategy in dict.fromkeys((run.task, run.strategy) for run in runs):
        mine = [run for run in runs if (run.task, run.strategy) == (task, strategy)]
        for number, scored in enumerate(mine[0].scores):
            each = [run.scores[number] for run in mine]
            spreads = [_spread(one.values) for one in each] if scored.averaged else []
            values = [one.value for one in each]
            rows.append(heading.row(task, strategy, scored.score.metric, scored.unit, values, spreads, **heading.modes))
    return rows


def _spread(values: Float[np.ndarray, " steps"]) -> float:
    """Over the steps that count; NaN where none does."""
    counted = values[np.isfinite(values)]
    return float(counted.std()) if len(counted) else float("nan")


def tick_rows(experiment: str, runs: Sequence[Run]) -> list[Row]:
    """Two rows a strategy: median and 99th percentile of its control steps [ms], over all its runs."""
    heading, rows = Heading.of(experiment, runs), []
    for strategy in dict.fromkeys(run.strategy for run in runs):
        ticks = np.concatenate([1e3 * run.episode.ran("tick_time") for run in runs if run.strategy == strategy])
        for metric, share in (("tick, median", 50), ("tick, 99th percentile", 99)):
            value = float(np.percentile(ticks, share))
            rows.append(heading.row("all", strategy, metric, "ms", [value]))
    return rows


def training_rows(experiment: str, trained: Sequence[TrainedNetworks]) -> list[Row]:
    """One row a network: held-out error [% of full range]."""
    first, seeds = trained[0], tuple(networks.seed for networks in trained)
    heading = Heading(experiment, first.arm, first.recipe.name, seeds)
    errors = {name: zip(*(networks.percent[name] for networks in trained), strict=True) for name in first.percent}
    return [
        heading.row("training", name, "held-out error", "%", *pairs, **heading.modes) for name, pairs in errors.items()
    ]
