"""S2C: from wanted states to the next configuration, by optimising through a forward model."""

from s2c2a.planning.batch import BatchPlanner
from s2c2a.planning.goal import Goal
from s2c2a.planning.objective import objective
from s2c2a.planning.options import AnyPlannerOptions, LeastSquaresOptions, PlannerOptions
from s2c2a.planning.planner import Plan, Planner
from s2c2a.planning.solver import solve

__all__ = [
    "AnyPlannerOptions",
    "BatchPlanner",
    "Goal",
    "LeastSquaresOptions",
    "Plan",
    "Planner",
    "PlannerOptions",
    "objective",
    "solve",
]
