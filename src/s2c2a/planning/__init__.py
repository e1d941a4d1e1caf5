"""S2C: planning of configurations by optimization through a forward model."""

from s2c2a.goals import Goal
from s2c2a.planning.guides import Detour, Guide
from s2c2a.planning.horizon import Horizon
from s2c2a.planning.outcomes import SIGNIFICANT, Outcome, plan_error
from s2c2a.planning.planner import BEST, PAPER, Plan, Planner, PlannerOptions, Step
from s2c2a.planning.solvers import Adam, Problem, Solver, reach_gaps
from s2c2a.planning.terms import Candidate, Guard, Residual, Situation, Term
from s2c2a.plugins.components import CustomComponent
