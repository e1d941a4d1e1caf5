"""From runs and trainings to rows, over seeds; what the paper printed stands beside them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec, load_arm, preset_names
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.jobs.job import Run
from s2c2a.robots.simulation.modes import first_mode
from s2c2a.strategies import TrainedNetworks

Floats = Sequence[float]

TILTS = {
    "tilt-40": (((2.9, 0.8), (2.1, 1.3)), ((3.3, 1.0), (2.1, 1.4))),
    "tilt-50": (((2.3, 0.7), (2.8, 1.4)), ((3.9, 1.4), (4.5, 2.2))),
    "tilt-60": (((2.2, 1.1), (3.5, 2.9)), ((4.5, 1.0), (7.5, 3.7))),
    "tilt-0": (((2.6, 1.0), (3.3, 1.0)), ((2.9, 0.8), (4.7, 2.2))),
    "tilt-50-a20": (
        ((3.1, 1.6), (2.4, 1.5), (3.6, 2.7)),
        ((4.8, 1.4), (3.9, 2.3), (6.8, 3.4)),
    ),
    "tilt-50-c20": (
        ((3.1, 1.2), (3.0, 2.3), (3.5, 3.1)),
        ((3.8, 1.1), (5.9, 2.0), (4.4, 2.2)),
    ),
}
"""Table III: task -> ours, PCC; each position [cm], tilt [deg] and where printed
azimuth [deg], mean and deviation."""

PRINTED: dict[tuple[str, str, str], dict[str, tuple[float, float]]] = {
    ("circle", "twin_arm", "s2c2a"): {"position": (2.2, 1.1)},  # table III, p-ours
    ("circle", "twin_arm", "pcc"): {"position": (2.5, 0.8)},  # table III, p-PCC
    # table on the simulation
    ("circle", "simulated_arm", "s2c2a"): {"position": (1.5, 0.3)},
    ("circle", "simulated_arm", "s2c2a-motor"): {"position": (1.9, 0.7)},  # the same
    ("circle", "simulated_arm", "lstm"): {"position": (3.3, 1.7)},  # the same
    **{
        (task, "twin_arm", strategy): dict(
            zip(("position", "tilt", "azimuth"), pairs, strict=False)
        )
        for task, columns in TILTS.items()
        for strategy, pairs in zip(("s2c2a", "pcc"), columns, strict=True)
    },
    # sensing coupling
    ("circle", "simulated_arm_sensing_coupled", "s2c2a"): {"position": (1.7, 0.3)},
    # actuation coupling
    ("circle", "simulated_arm_actuation_coupled", "s2c2a"): {"position": (1.6, 0.5)},
    # table V
    ("hold-base", "twin_arm", "s2c2a"): {
        "constraint": (0.2, 0.1),
        "position": (3.6, 1.7),
    },
    ("hold-middle", "twin_arm", "s2c2a"): {
        "constraint": (1.0, 0.3),
        "orientation": (3.2, 1.9),
    },
    ("hold-end", "twin_arm", "s2c2a"): {
        "constraint": (3.9, 0.9),
        "orientation": (4.3, 2.5),
    },
    ("training", "twin_arm", "C2S"): {"held-out error": (1.93, 1.87)},  # table II
    ("training", "twin_arm", "C2A"): {"held-out error": (0.91, 1.90)},  # table II
}
"""Chen et al. 2025. Its simulation compares with other things than PCC, so those rows
have no number beside them."""


@dataclass(frozen=True)
class Heading:
    """What rows of one arm share.

    Attributes:
        experiment: what they belong to.
        arm: the arm.
        recipe: its name.
        seeds: of data, training and start.
        fidelity: of the simulation.
        as_described: whether the body that ran is the simulation of this description.
    """

    experiment: str
    arm: ArmSpec
    recipe: str
    seeds: tuple[int, ...]
    fidelity: str = "fast"
    as_described: bool = True

    @classmethod
    def of(cls, experiment: str, runs: Sequence[Run]) -> "Heading":
        """That of one arm's runs under one set of conditions."""
        job = runs[0].job
        seeds = tuple(dict.fromkeys(run.seed for run in runs))
        body = job.conditions.body
        described = body.simulated and "twin" not in dict(body.options)
        return cls(
            experiment,
            job.arm,
            job.recipe.name,
            seeds,
            job.conditions.fidelity,
            described,
        )

    @cached_property
    def modes(self) -> dict[str, Any]:
        """The arm's first mode: a stiffer or slower arm makes every task easy; of another body nobody knows it."""
        if not self.as_described:
            return {}
        return dict(
            zip(("first_mode_hz", "damping_ratio"), first_mode(self.arm), strict=True)
        )

    def row(
        self,
        task: str,
        strategy: str,
        metric: str,
        unit: str,
        values: Floats,
        spreads: Floats = (),
        **more: Any,
    ) -> Row:
        """A row of one value a seed, and of spreads over the steps of a run; what the paper printed is beside it."""
        more = (
            over_seeds(values, spreads)
            | {"seeds": self.seeds}
            | printed(task, self.arm, strategy, metric)
            | more
        )
        return Row(
            self.experiment,
            task,
            self.arm.name,
            self.fidelity,
            strategy,
            self.recipe,
            metric,
            unit,
            **more,
        )


def score_rows(experiment: str, runs: Sequence[Run]) -> list[Row]:
    """One row for every task, strategy and metric of one arm's runs, its first mode beside it."""
    heading = Heading.of(experiment, runs)
    rows = []
    for task, strategy in dict.fromkeys((run.task, run.strategy) for run in runs):
        mine = [run for run in runs if (run.task, run.strategy) == (task, strategy)]
        for each in zip(*(run.scores for run in mine), strict=True):
            first = each[0]
            values = [one.value for one in each]
            spreads = [_spread(one.values) for one in each] if first.averaged else []
            rows.append(
                heading.row(
                    task,
                    strategy,
                    first.score.metric,
                    first.unit,
                    values,
                    spreads,
                    **heading.modes,
                )
            )
    return rows


def _spread(values: Float[np.ndarray, " steps"]) -> float:
    """Over the steps that count; NaN where none does."""
    counted = values[np.isfinite(values)]
    return float(counted.std()) if len(counted) else float("nan")


def tick_rows(experiment: str, runs: Sequence[Run]) -> list[Row]:
    """Two rows a strategy: median and 99th percentile of its control steps [ms], over all its runs."""
    heading = Heading.of(experiment, runs)
    rows = []
    for strategy in dict.fromkeys(run.strategy for run in runs):
        ticks = np.concatenate(
            [
                1e3 * run.episode.ran("tick_time")
                for run in runs
                if run.strategy == strategy
            ]
        )
        for metric, share in (("tick, median", 50), ("tick, 99th percentile", 99)):
            rows.append(
                heading.row(
                    "all", strategy, metric, "ms", [float(np.percentile(ticks, share))]
                )
            )
    return rows


def training_rows(experiment: str, trained: Sequence[TrainedNetworks]) -> list[Row]:
    """One row a network: held-out error [% of full range]."""
    first = trained[0]
    seeds = tuple(networks.seed for networks in trained)
    heading = Heading(experiment, first.arm, first.recipe.name, seeds)
    errors = {
        name: zip(*(networks.percent[name] for networks in trained), strict=True)
        for name in first.percent
    }
    return [
        heading.row("training", name, "held-out error", "%", *pairs, **heading.modes)
        for name, pairs in errors.items()
    ]


def printed(task: str, arm: ArmSpec, strategy: str, metric: str) -> dict[str, Any]:
    """`paper_mean` and `paper_std` of a row, nothing where the paper prints nothing or the arm is not the preset."""
    pair = PRINTED.get((task, arm.name, strategy), {}).get(metric)
    if pair is None or (
        arm.name in preset_names() and not arm.same_mechanics(load_arm(arm.name))
    ):
        return {}
    return {"paper_mean": pair[0], "paper_std": pair[1]}
