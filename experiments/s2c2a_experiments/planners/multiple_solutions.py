"""Several inverse solutions, chosen by dynamic programming: [24KQ] of Table I.

Many starts lead to several shapes for the present target and for the targets of the
preview. Dynamic programming over the preview then chooses one for each moment, so that
bends change little and obstacles stay clear. Qiu et al. (Robotics: Science and Systems
2023) find the shapes of three arcs in closed form; here damped least squares from spread
starts find those of any arm.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.goals import Goal
from s2c2a.planning import Guard
from s2c2a.plugins.components import Ranges
from s2c2a_experiments.planners.arc_driver import BendPlanning, Bends, Moment
from s2c2a_experiments.planners.arc_solutions import (
    DEPTH_WEIGHT,
    WAY_POINTS,
    ArcSolutions,
    Batch,
    Values,
)

MOMENTS = (3, 7, 11)  # of the preview, beside the present: all of its time
ALIKE = 0.05  # rad; nearer shapes are one solution
NEVER = 1e9  # cost of a solution that is another's double
FIXED_SEED = 0

Layer = tuple[Batch, Values]
"""Solutions of a moment, and what each costs by itself [rad2]."""


@dataclass(frozen=True)
class MultipleSolutions(BendPlanning):
    """Many inverse solutions a moment, chosen by dynamic programming.

    Attributes:
        solutions: starts of every moment, the last solutions among them.
        reach_weight: cost of the error of targets, in rad2 for 0.4 arm lengths, squared.
        margin: around obstacles, in parts of the arm's length.
        pace: largest step, in parts of the step limit.
    """

    solutions: int = 12
    reach_weight: float = 100.0
    margin: float = 0.04
    pace: float = 1.0
    name = "multi-ik"
    supports = frozenset({"guard"})
    limits: ClassVar[Ranges] = {
        "solutions": (2, 200),
        "reach_weight": (0.0, 1e6),
        "margin": (0.0, 1.0),
        "pace": (0.01, 1.0),
    }

    def planner(self, arm: ArmSpec, guard: Guard) -> "ChosenSolutions":
        solver = ArcSolutions(arm, guard, self.margin)
        return ChosenSolutions(solver, self)


class ChosenSolutions:
    """Solutions of the present and of the preview, and the choice among them."""

    def __init__(self, solver: ArcSolutions, options: MultipleSolutions):
        """Compile the solver."""
        self._solver = solver
        self._options = options
        self._count = options.solutions
        total = self._count * (len(MOMENTS) + 1)
        solver.warm_up(total, WAY_POINTS * total)

    def start(self, moment: Moment) -> None:
        """Begin with an arm at rest."""
        self._random = np.random.default_rng(FIXED_SEED)
        self._spread = self._solver.spread(1024)
        self._chosen = [moment.bends] * (len(MOMENTS) + 1)

    def next_bends(self, moment: Moment, goal: Goal) -> Bends:
        """Toward the present's part of the best sequence of solutions."""
        if not goal.has_target:
            return moment.bends
        solver = self._solver
        last = moment.bends
        layers = self._layers(last, goal)
        self._chosen = best_sequence(last, layers)
        step = solver.step(last, self._chosen[0], self._options.pace)
        return solver.outside(step, goal)

    def _layers(self, last: Bends, goal: Goal) -> list[Layer]:
        """Solutions of every moment, and what each costs by itself."""
        targets = np.repeat(_targets_of(goal), self._count, axis=0)
        groups = [self._starts(last, chosen) for chosen in self._chosen]
        starts = np.concatenate(groups)
        bends, errors = self._solver.solve(starts, goal, targets=targets)
        costs = self._options.reach_weight * errors**2
        costs = costs + self._depth_costs(last, bends, goal)
        moments = len(groups)
        solutions = np.split(bends, moments)
        own_costs = np.split(costs, moments)
        layers = []
        for found, own in zip(solutions, own_costs, strict=True):
            # one for solutions that are alike to a cheaper one, or to an earlier as
            # cheap
            is_alike = _squared_changes(found, found) < ALIKE**2
            ranking = np.argsort(own, kind="stable")
            ranks = np.argsort(ranking)
            is_dearer = ranks[:, None] > ranks
            is_double = is_alike & is_dearer
            doubles = is_double.any(axis=1).astype(float)
            never = NEVER * doubles
            layers.append((found, own + never))
        return layers

    def _starts(self, last: Bends, chosen: Bends) -> Batch:
        known = [last, chosen, self._chosen[0]]
        known = known[: self._count]
        others = self._count - len(known)
        rows = self._random.integers(len(self._spread), size=others)
        return np.concatenate([np.array(known), self._spread[rows]])

    def _depth_costs(self, last: Bends, bends: Batch, goal: Goal) -> Values:
        """Of depth within the margin, in the present on the way there."""
        solver = self._solver
        starts = np.array(bends)
        starts[: self._count] = last
        clearances = solver.way_clearances(starts, bends, goal)
        depths = np.maximum(solver.margin - clearances, 0.0)
        weight = self._options.reach_weight * DEPTH_WEIGHT
        return weight * depths / solver.length


def best_sequence(last: Bends, layers: Sequence[Layer]) -> list[Bends]:
    """One solution of every moment, with the least cost and squared changes of bends.

    Args:
        last: bends before them [rad].
        layers: solutions of every moment, and the cost of each [rad2].
    """
    shapes = last[None]
    totals = np.zeros(1)
    sources = []
    for solutions, costs in layers:
        changes = _squared_changes(shapes, solutions)
        ways = totals[:, None] + changes
        sources.append(ways.argmin(axis=0))
        shapes = solutions
        totals = ways.min(axis=0) + costs
    chosen = int(totals.argmin())
    best = []
    backward = zip(reversed(layers), reversed(sources), strict=True)
    for (solutions, _), source in backward:
        best.append(solutions[chosen])
        chosen = int(source[chosen])
    best.reverse()
    return best


def _targets_of(goal: Goal) -> Float[np.ndarray, "moments modules 6"]:
    """Positions and axes at the moments; what is not known stays as it is."""
    present = np.concatenate([goal.positions, goal.axes], axis=-1)
    preview = goal.preview[list(MOMENTS)]
    is_known = np.isfinite(preview)
    later = np.where(is_known, preview, present)
    return np.concatenate([present[None], later])


def _squared_changes(before: Batch, after: Batch) -> Float[np.ndarray, "before after"]:
    changes = before[:, None] - after
    squares = changes**2
    return squares.sum(axis=(-2, -1))
