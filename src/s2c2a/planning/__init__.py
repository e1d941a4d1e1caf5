"""S2C: from wanted states to the next configuration, by optimising through a forward model."""

from s2c2a.goals import Goal
from s2c2a.parts import Own
from s2c2a.planning.batch import BatchPlanner
from s2c2a.planning.guides import Detour, Guide, Pull
from s2c2a.planning.planner import BEST, PAPER, Plan, Planner, PlannerOptions
from s2c2a.planning.rescue import NO_RESCUE, Notes, Rescue
from s2c2a.planning.solvers import Adam, LeastSquares, Problem, Solver, reach_gaps
from s2c2a.planning.terms import Candidate, Guard, Residual, Situation, Term
