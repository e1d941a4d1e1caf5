"""Result rows of runs and trainings over seeds, with the paper's numbers."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from s2c2a.arm import ArmSpec, load_arm, preset_names
from s2c2a.evaluation.metrics import spread
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.jobs.job import Run
from s2c2a.robots.simulation.modes import first_mode
from s2c2a.strategies import TrainedNetworks
from s2c2a.training.fit import is_fixed

Floats = Sequence[float]

PRINTED = Path(__file__).with_name("printed.csv")
"""Mean and standard deviation of each metric that the paper prints (Chen et al. 2025).

Table III has the rows of `tilt` and of the circle of `twin_arm`, the table of the
simulation those of the other arms, of which the last two couple sensing and actuation;
table V has `hold`, table II `training`. The paper compares its simulation with other
methods than PCC, so these rows have no printed number."""
DISTURBING = {"twin", "payload", "events", "aged"}
"""Options of the simulated robot for conditions that the paper does not have."""


@dataclass(frozen=True)
class Heading:
    """Fields that the rows of one arm share.

    Attributes:
        experiment: its name.
        arm: the arm.
        recipe: name of the recipe.
        seeds: of data, training and start.
        fidelity: of the simulation.
        as_described: whether the robot is the simulation of this arm.
        as_in_paper: whether nothing disturbs it, so that the paper's numbers compare.
    """

    experiment: str
    arm: ArmSpec
    recipe: str
    seeds: tuple[int, ...]
    fidelity: str = "fast"
    as_described: bool = True
    as_in_paper: bool = True

    @classmethod
    def of(cls, experiment: str, runs: Sequence[Run]) -> "Heading":
        """The heading of one arm's runs under one set of conditions."""
        job = runs[0].job
        conditions = job.conditions
        robot = conditions.robot
        options = dict(robot.options)
        return cls(
            experiment,
            job.arm,
            job.recipe.name,
            tuple(dict.fromkeys(run.seed for run in runs)),
            conditions.fidelity,
            robot.simulated and "twin" not in options,
            robot.simulated and not DISTURBING & options.keys(),
        )

    @cached_property
    def modes(self) -> dict[str, Any]:
        """Frequency and damping ratio of the arm's first mode, if they are known.

        They go with scores because tasks are easier with a stiffer or slower arm.
        """
        if not self.as_described:
            return {}
        frequency, damping_ratio = first_mode(self.arm)
        return {"first_mode_hz": frequency, "damping_ratio": damping_ratio}

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
        """A row of one value a seed, with the paper's number.

        Args:
            task: name.
            strategy: name.
            metric: name.
            unit: of the values.
            values: one for each seed.
            spreads: over the steps of each run; empty if there is none.
            more: other fields of the row.
        """
        fields = over_seeds(values, spreads) | {"seeds": self.seeds}
        if self.as_in_paper:
            fields |= printed(task, self.arm, strategy, metric)
        return Row(
            self.experiment,
            task,
            self.arm.name,
            self.fidelity,
            strategy,
            self.recipe,
            metric,
            unit,
            **(fields | more),
        )


def score_rows(experiment: str, runs: Sequence[Run]) -> list[Row]:
    """Make a row for every task, strategy and metric of one arm's runs.

    Args:
        experiment: its name.
        runs: under one set of conditions, with all seeds.
    """
    heading = Heading.of(experiment, runs)
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.task, run.strategy), []).append(run)
    rows = []
    for (task, strategy), group in groups.items():
        for over_runs in zip(*(run.scores for run in group), strict=True):
            first = over_runs[0]
            metric = first.score.metric
            values = [scored.value for scored in over_runs]
            spreads = [spread(scored.values) for scored in over_runs if first.averaged]
            names = (task, strategy, metric, first.unit)
            rows.append(heading.row(*names, values, spreads, **heading.modes))
    return rows


def describe_repetitions(run: Run) -> str:
    """Describe the scores of every repetition of a run, the first one first."""
    scores = [run.job.score(episode) for episode in run.earlier]
    texts = []
    for results in zip(*scores, run.scores, strict=True):
        values = ", ".join(f"{result.value:.2f}" for result in results)
        first = results[0]
        texts.append(f"{first.score.metric} by repetition {values} {first.unit}")
    return "; ".join(texts)


def training_rows(experiment: str, trained: Sequence[TrainedNetworks]) -> list[Row]:
    """Make a row of the held-out error of each network [% of full range].

    Fixed parts have none, such as the modal model: its percentage is a share of the
    vibration.

    Args:
        experiment: its name.
        trained: networks of one arm, one for each seed.
    """
    first = trained[0]
    seeds = tuple(networks.seed for networks in trained)
    heading = Heading(experiment, first.arm, first.recipe.name, seeds)
    rows = []
    for name in first.trained:
        if is_fixed(first.trained[name].network):
            continue
        percents = [networks.trained[name].percent for networks in trained]
        means, spreads = zip(*percents, strict=True)
        names = ("training", name, "held-out error", "%")
        rows.append(heading.row(*names, means, spreads, **heading.modes))
    return rows


def printed(task: str, arm: ArmSpec, strategy: str, metric: str) -> dict[str, Any]:
    """`paper_mean` and `paper_std` of a row.

    Returns:
        Nothing if the paper prints no number, or if an arm has the name of a preset but
        other mechanics.
    """
    if arm.name in preset_names() and arm.differences(load_arm(arm.name)):
        return {}
    with PRINTED.open(encoding="utf-8", newline="") as file:
        for *names, mean, std in csv.reader(file):
            if names == [task, arm.name, strategy, metric]:
                return {"paper_mean": float(mean), "paper_std": float(std)}
    return {}
