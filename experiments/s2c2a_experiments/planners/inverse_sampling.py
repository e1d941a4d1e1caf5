"""Inverse model with sampling: [14JL] of Table I.

Each step samples the redundant part of a shape, the bends of the inner modules, around
the last bends and across all limits. The outer modules are then solved for the target;
the literature does so in closed form for planar arcs, here a few damped least squares
steps do for any. What misses the target or collides is rejected, and of the rest the one
that changes bends least is kept.
"""

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
    WAY_POINTS,
    ArcSolutions,
    Batch,
    SolvedShapes,
    Values,
)

SOLVED = 2  # outer modules for a position: two arcs reach it if it is in reach
SOLVED_WITH_AXIS = 3
SMALLEST_SHARE = 1e-2  # of the limits; of samples around the last bends
SCORE_OF_DEPTH = 1e3  # rad2 an arm length; as good as rejected
SCORE_OF_ERROR = 1e2  # rad2; for 0.4 arm lengths, squared
FIXED_SEED = 0


@dataclass(frozen=True)
class InverseSampling(BendPlanning):
    """Samples the redundant bends, and solves the others.

    Attributes:
        samples: a control step.
        global_share: of the samples that are spread over all limits.
        margin: around obstacles, in parts of the arm's length.
        pace: largest step, in parts of the step limit.
    """

    samples: int = 32
    global_share: float = 0.5
    margin: float = 0.04
    pace: float = 1.0
    name = "inverse-sampling"
    supports = frozenset({"guard"})
    limits: ClassVar[Ranges] = {
        "samples": (3, 500),
        "global_share": (0.0, 1.0),
        "margin": (0.0, 1.0),
        "pace": (0.01, 1.0),
    }

    def planner(self, arm: ArmSpec, guard: Guard) -> "SampledInverse":
        solver = ArcSolutions(arm, guard, self.margin)
        return SampledInverse(solver, self)


class SampledInverse:
    """Draws shapes, solves them, and keeps the best."""

    def __init__(self, solver: ArcSolutions, options: InverseSampling):
        """Compile the solver."""
        self._solver = solver
        self._options = options
        solver.warm_up(options.samples, WAY_POINTS * options.samples)
        self._spread = solver.spread(1024)

    def start(self, moment: Moment) -> None:
        """Begin with an arm at rest."""
        self._random = np.random.default_rng(FIXED_SEED)
        self._best = moment.bends

    def next_bends(self, moment: Moment, goal: Goal) -> Bends:
        """Toward the best sample."""
        if not goal.has_target:
            return moment.bends
        solver = self._solver
        last = moment.bends
        samples = self._samples(last)
        solved = solver.solve(samples, goal, moved_modules(goal))
        scores = self._scores(last, solved, goal)
        best = np.argmin(scores)
        self._best = solved.bends[best]
        step = solver.step(last, self._best, self._options.pace)
        return solver.outside(step, goal)

    def _scores(self, last: Bends, solved: SolvedShapes, goal: Goal) -> Values:
        """Squared changes of bends, and what errors and collisions cost [rad2]."""
        solver = self._solver
        changes = solved.bends - last
        scores = (changes**2).sum(axis=(1, 2))
        scores = scores + SCORE_OF_ERROR * solved.errors**2
        gaps = solver.way_clearances(last, solved.bends, goal)
        depths = np.maximum(solver.margin - gaps, 0.0)
        depths = depths / solver.length
        return scores + SCORE_OF_DEPTH * depths

    def _samples(self, last: Bends) -> Batch:
        """The last bends, the best before, and samples around the last and of all."""
        known = np.array([last, self._best])
        drawn = self._options.samples - len(known)
        rows = self._random.integers(len(self._spread), size=drawn)
        spread = self._spread[rows]
        exponents = self._random.random(drawn)
        shares = SMALLEST_SHARE**exponents
        near = last + shares[:, None, None] * spread
        global_count = self._options.global_share * drawn
        is_global = np.arange(drawn) < global_count
        samples = np.where(is_global[:, None, None], spread, near)
        return np.concatenate([known, samples])


def moved_modules(goal: Goal) -> Float[np.ndarray, " modules"]:
    """One for modules that are solved, zero for those that are sampled.

    Where inner ends have targets too, all are solved, from the samples.
    """
    modules = len(goal.positions)
    weights = goal.position_weights + goal.axis_weights
    solved = SOLVED
    if goal.axis_weights[-1] != 0.0:
        solved = SOLVED_WITH_AXIS
    if weights[:-1].any():
        solved = modules
    numbers = np.arange(modules)
    is_solved = numbers >= modules - solved
    return is_solved.astype(np.float32)
