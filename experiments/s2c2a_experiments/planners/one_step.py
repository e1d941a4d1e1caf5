"""What planners by a forward model and optimization share: one step by least squares.

Each control step, damped least squares choose the configuration whose prediction is
nearest to the goal. They look no step ahead and know no way around obstacles. Encoders
and cables are those of the strategy `pcc`, so that a comparison shows the model alone.
"""

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from s2c2a.arm import ArmSpec
from s2c2a.control import InversePCC
from s2c2a.estimation import EncoderEstimator, EncoderMap
from s2c2a.kinematics import PCC, configurations_from_bends
from s2c2a.models.forward_model import ForwardModel
from s2c2a.planning import Guard, Planner, PlannerOptions, Problem, Solver
from s2c2a.planning.solvers import solve_least_squares
from s2c2a.planning.terms import (
    Axes,
    Candidate,
    Configurations,
    Evenness,
    Limits,
    Obstacles,
    Positions,
    Residual,
    Situation,
    Term,
)
from s2c2a.plugins.components import Ranges
from s2c2a.strategies import (
    Recipe,
    RunOptions,
    Strategy,
    StrategyOptions,
    TrainedNetworks,
)


@dataclass(frozen=True)
class LeastSquares(Solver):
    """Levenberg-Marquardt on bends of one step; every iterate stays within the step limit.

    Attributes:
        iterations: in a control step.
    """

    iterations: int = 10

    def solve(self, problem: Problem) -> Configurations:
        start = problem.situation.last.bends
        bends, _ = solve_least_squares(
            problem.stacked, start, problem.within_step, self.iterations
        )
        return configurations_from_bends(bends)


@dataclass(frozen=True)
class BendChange(Term):
    """Change of bends: mu_d of the goal.

    Attributes:
        weight: [1/rad].
    """

    weight: float = 0.03

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Shape (modules, 2)."""
        change = candidate.bends - situation.last.bends
        return situation.goal.change_weight, self.weight * change


@dataclass(frozen=True)
class OneStep(StrategyOptions):
    """A forward model, and least squares on its prediction of the next step.

    Attributes:
        axis_weight: of axes beside positions.
        change_weight: of the change of bends [1/rad].
        evenness: of the difference between neighboring bends [1/rad].
        obstacle_weight: of the depth in obstacles beside positions.
    """

    axis_weight: float = 0.5
    change_weight: float = 0.2
    evenness: float = 0.02
    obstacle_weight: float = 20.0
    supports = frozenset({"guard"})
    recipe_keys = frozenset()
    limits: ClassVar[Ranges] = {
        "axis_weight": (0.0, 100.0),
        "change_weight": (0.0, 100.0),
        "evenness": (0.0, 100.0),
        "obstacle_weight": (0.0, 1000.0),
    }

    @abstractmethod
    def model(self, arm: ArmSpec) -> ForwardModel:
        """The forward model of an arm."""

    def build(
        self,
        arm: ArmSpec,
        recipe: Recipe,
        trained: TrainedNetworks | None,
        run: RunOptions,
    ) -> Strategy:
        """See `StrategyOptions`."""
        pcc = PCC.of(arm)
        return Strategy(
            self.name,
            arm,
            EncoderEstimator(EncoderMap(pcc)),
            Planner(arm, self.model(arm), self._planner(run.guard)),
            InversePCC(pcc, jnp.ones(arm.module_count)),
        )

    def _planner(self, guard: Guard) -> PlannerOptions:
        terms = (
            Positions(),
            Axes(self.axis_weight),
            Evenness(self.evenness),
            Limits(),
            Obstacles(self.obstacle_weight),
            BendChange(self.change_weight),
        )
        return PlannerOptions(LeastSquares(), terms, guard=guard)
