"""Which recording trains the strategy best: babbling compared in closed loop.

Every arm is recorded with each kind of babbling, trained, and follows the tasks; the
errors of one kind count beside those of the first on the same arm, task and seed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from s2c2a import jobs
from s2c2a.arm import ArmSpec
from s2c2a.errors import counted
from s2c2a.evaluation import Row
from s2c2a.strategies import recipe_named
from s2c2a_experiments.run_rows import labeled

EXPERIMENT = "data"
SCORED = "position", "constraint"  # metrics of the runs, in cm
RATIO = "error, share of that of the first kind"
BOUND = "the same, two standard errors over arms more"


@dataclass(frozen=True)
class DataStudy:
    """What is compared.

    Attributes:
        arms: each with a recording of its own for every kind and seed.
        kinds: of babbling; the others are compared with the first.
        tasks: names.
        seeds: of data, training and start.
    """

    arms: tuple[ArmSpec, ...]
    kinds: tuple[str, ...] = ("coverage", "mixed", "coverage-mixed")
    tasks: tuple[str, ...] = ("circle", "square", "tilt-50", "hold-middle")
    seeds: tuple[int, ...] = (0, 1, 2)


def data_rows(study: DataStudy, make: jobs.Make) -> list[Row]:
    """Rows of every arm, and the ratios of errors over all of them.

    Args:
        study: what is compared.
        make: finds or makes runs, networks and recordings.
    """
    best = recipe_named("best")
    cases = list(product(study.arms, study.kinds))
    groups = [
        jobs.jobs_for(
            study.tasks, arm, ["s2c2a"], study.seeds, replace(best, babbling=kind)
        )
        for arm, kind in cases
    ]
    rows: list[Row] = []
    for (_, kind), runs in zip(cases, jobs.in_groups(make, groups), strict=True):
        rows += labeled(jobs.score_rows(EXPERIMENT, runs), kind)
    return [*ratio_rows(rows, study.kinds), *rows]


def ratio_rows(rows: Sequence[Row], kinds: Sequence[str]) -> Iterator[Row]:
    """Errors beside those of the first kind, and how certain the ratios are.

    Means are of logarithms, over the tasks of an arm, then over arms.

    Args:
        rows: of every arm, task and kind.
        kinds: of babbling; the first is the reference.
    """
    scored = [row for row in rows if row.metric in SCORED]
    errors = {(row.arm, row.task, row.strategy): row.mean for row in scored}
    arms = list(dict.fromkeys(row.arm for row in scored))
    tasks = list(dict.fromkeys(row.task for row in scored))
    heading = replace(
        scored[0],
        arm=f"all {counted(len(arms), 'arm')}",
        task="all tasks",
        std_steps=None,
        std_seeds=None,
        first_mode_hz=None,
        damping_ratio=None,
    )
    for kind in kinds[1:]:
        logarithms = [
            np.mean(
                [
                    np.log(errors[arm, task, kind] / errors[arm, task, kinds[0]])
                    for task in tasks
                    if (arm, task, kind) in errors
                ]
            )
            for arm in arms
        ]
        mean = float(np.mean(logarithms))
        deviation = float(np.std(logarithms, ddof=1)) if len(arms) > 1 else np.inf
        error = deviation / np.sqrt(len(arms))
        for metric, value in ((RATIO, np.exp(mean)), (BOUND, np.exp(mean + 2 * error))):
            yield replace(
                heading, strategy=kind, metric=metric, unit="times", mean=float(value)
            )


def choice(rows: Sequence[Row], kinds: Sequence[str]) -> str:
    """The kind with the smallest errors; the first unless another is surely better.

    Args:
        rows: of `ratio_rows`, perhaps among others.
        kinds: of babbling; the first is the reference.
    """
    better = {row.strategy for row in rows if row.metric == BOUND and row.mean < 1.0}
    ratios = {row.strategy: row.mean for row in rows if row.metric == RATIO}
    return min(better, key=ratios.__getitem__, default=kinds[0])
