"""S2C: from wanted states to the next configuration, by optimising through a forward model."""

from s2c2a.goals import Goal
from s2c2a.parts import Own
from s2c2a.planning.batch import BatchPlanner
from s2c2a.planning.detour import Detour
from s2c2a.planning.guides import Guide, Pull
from s2c2a.planning.options import BEST, PAPER, PlannerOptions
from s2c2a.planning.planner import Plan, Planner
from s2c2a.planning.situation import Candidate, Situation
from s2c2a.planning.solvers import Adam, LeastSquares, Problem, Solver
from s2c2a.planning.terms import Residual, Term
