"""Shapes: how near the whole arm comes to a curve that it is given.

`own` curves are center lines of the true arm at rest. `foreign` curves are those of an arm
with other modules, which the arm meets nowhere exactly: a search over its resting shapes
finds the least distance that is possible.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from s2c2a import jobs
from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import center_line, directions_at
from s2c2a.evaluation import Row, curve_distances
from s2c2a.kinematics import states_from_bends
from s2c2a.strategies import recipe_named
from s2c2a.tasks import Task, shape_task
from s2c2a_experiments.randomized_arms import AGED
from s2c2a_experiments.run_rows import metric_rows
from s2c2a_experiments.true_reach import TrueReach

EXPERIMENT = "shapes"
STRATEGIES = ("s2c2a", "pcc")
LARGEST_BEND = 0.8  # of the limits
FOREIGN_MODULES = (0.25, 0.45, 0.3)  # lengths, of the arm's length


@dataclass(frozen=True)
class ShapeStudy:
    """What is compared.

    Attributes:
        arms: that take the shapes.
        curves: number of own curves, and of foreign ones.
        seeds: of data, training and start.
    """

    arms: tuple[ArmSpec, ...]
    curves: int = 10
    seeds: tuple[int, ...] = (0,)


@dataclass(frozen=True, eq=False)  # tasks hold arrays
class CurveSet:
    """Curves of one kind for one arm.

    Attributes:
        name: of the kind.
        arm: that takes the shapes.
        tasks: one a curve.
        best_fits: least possible mean distance of its center line [cm], one a curve.
    """

    name: str
    arm: ArmSpec
    tasks: Sequence[Task]
    best_fits: Sequence[float]

    def make_jobs(self, strategy: str, seeds: Sequence[int]) -> list[jobs.Job]:
        """Runs of all curves."""
        recipe = recipe_named("best")
        return jobs.jobs_for(self.tasks, self.arm, [strategy], seeds, recipe, AGED)

    def rows(self, runs: Sequence[jobs.Run]) -> list[Row]:
        """Rows over all runs of one strategy."""
        distances = [_score(run, "shape") for run in runs]
        mean = float(np.mean(distances))
        least = float(np.mean(self.best_fits))
        metrics = {
            ("shape", "cm"): [mean],
            ("shape, largest", "cm"): [max(distances)],
            ("end distance", "cm"): [
                float(np.mean([_score(run, "end distance") for run in runs]))
            ],
            ("best fit", "cm"): [least],
        }
        task = f"{self.name} curves"
        return metric_rows(EXPERIMENT, runs, runs[0].strategy, metrics, task)


def shape_rows(study: ShapeStudy, make: jobs.Make) -> list[Row]:
    """Rows of every arm, kind of curves and strategy.

    Args:
        study: what is compared.
        make: finds or makes runs, networks and recordings.
    """
    sets = [
        curves(arm, study.curves) for arm in study.arms for curves in (_own, _foreign)
    ]
    cases = list(product(sets, STRATEGIES))
    groups = [curves.make_jobs(strategy, study.seeds) for curves, strategy in cases]
    rows = []
    for (curves, _), runs in zip(cases, jobs.in_groups(make, groups), strict=True):
        rows += curves.rows(runs)
    return rows


def best_fit(reach: TrueReach, curve: np.ndarray) -> float:
    """Mean distance of the arm's center line from a curve at the best resting shape [cm].

    The search minimizes the root mean square of the distances.

    Args:
        reach: of the true arm.
        curve: its points [m], shape (points, 3).
    """
    lengths = ArmGeometry.of(reach.arm).lengths

    def distances(states: np.ndarray) -> np.ndarray:
        return curve_distances(center_line(states, lengths), curve)

    shape = reach.least(distances)
    return 100.0 * float(distances(shape.states).mean())


def _own(arm: ArmSpec, count: int) -> CurveSet:
    """Center lines of the true arm; they fit exactly."""
    reach = TrueReach(arm)
    drawn = drawn_directions(np.random.default_rng(0), count, arm.module_count)
    actions = LARGEST_BEND * reach.usable_range[:, None] * drawn
    lines = center_line(reach.states(actions), ArmGeometry.of(arm).lengths)
    return CurveSet("own", arm, _tasks("own", arm, _with_base(lines)), [0.0] * count)


def _foreign(arm: ArmSpec, count: int) -> CurveSet:
    """Center lines of an arm of arcs with other modules."""
    geometry = ArmGeometry.of(arm)
    lengths = arm.length * np.array(FOREIGN_MODULES)
    # as much bend a length as the arm has
    limits = lengths * (geometry.bend_limits / geometry.lengths).min()
    drawn = drawn_directions(np.random.default_rng(0), count, len(lengths))
    bends = LARGEST_BEND * limits[:, None] * drawn
    states = np.stack([np.asarray(states_from_bends(each, lengths)) for each in bends])
    lines = _with_base(center_line(states, lengths))
    reach = TrueReach(arm)
    tasks = _tasks("foreign", arm, lines)
    return CurveSet("foreign", arm, tasks, [best_fit(reach, line) for line in lines])


def drawn_directions(
    random: np.random.Generator, count: int, modules: int
) -> np.ndarray:
    """Vectors in the unit disc, nearby modules in similar directions."""
    sizes = np.sqrt(random.uniform(0.2, 1.0, (count, modules)))
    angles = random.uniform(0.0, 2.0 * np.pi, (count, 1))
    angles = angles + random.normal(0.0, 0.6, (count, modules))
    return sizes[..., None] * directions_at(angles)


def _with_base(lines: np.ndarray) -> np.ndarray:
    return np.concatenate([np.zeros_like(lines[:, :1]), lines], axis=1)


def _tasks(name: str, arm: ArmSpec, lines: np.ndarray) -> list[Task]:
    return [
        shape_task(f"{name} curve {number}", line, arm)
        for number, line in enumerate(lines)
    ]


def _score(run: jobs.Run, metric: str) -> float:
    (score,) = [one for one in run.scores if one.score.metric == metric]
    return score.value
