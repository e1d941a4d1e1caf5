"""Outcomes: how a control step was planned, and whether the plan reaches its goal.

One distance decides: that of the planned module ends from their goal, by the plan's own
model. A plan that has not reached its goal moves nearer, could move nearer but stands
still, or cannot move nearer. To tell the last two apart, the forward model is evaluated
once to each side of every bend, by the step limit, and the linear problem of these
slopes is solved within the limits. Slopes over a whole step also hold within a backlash,
where the derivative is zero.
"""

from enum import IntEnum

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from s2c2a.goals import Goal
from s2c2a.kinematics import limit_lengths
from s2c2a.planning.solvers import Problem, solve_least_squares
from s2c2a.planning.terms import Bends, Candidate, largest_bend, norm
from s2c2a.spaces import POSITION

REACHED = 2e-3  # of the arm's length: 1.2 mm on 0.6 m
STILL = 0.05  # of the step limit: a plan that moves less is still
SLOPE_ITERATIONS = 20  # of least squares on the linear problem

Count = Int[Array, ""]
Distance = Float[Array, ""]


class Outcome(IntEnum):
    """How a control step was planned; the value is the number in files."""

    sentence: str

    SOLVED = (
        0,
        "The plan is the result of the solver, and has reached its goal by the plan's "
        "own model.",
    )
    KEPT = (
        1,
        "The last plan is kept, because the solver's result is farther from the goal.",
    )
    RESTARTED = (
        2,
        "The plan is the result of a solver run from a random start, within the step "
        "limit.",
    )
    FALLBACK = (
        3,
        "The plan moves toward a better configuration that the fallback search found.",
    )
    STUCK = (
        4,
        "The plan makes no progress, although the fallback search knows a better "
        "configuration.",
    )
    STALLED = (
        5,
        "The plan stands still and has not reached its goal, although a step within "
        "the limits would get nearer.",
    )
    OUT_OF_REACH = (
        6,
        "The plan has not reached its goal, and no step within the limits gets nearer.",
    )
    MOVING = (
        7,
        "The plan is the result of the solver, and moves; it has not reached its goal.",
    )

    def __new__(cls, value: int, sentence: str) -> "Outcome":
        """A number with a sentence."""
        outcome = int.__new__(cls, value)
        outcome._value_ = value
        outcome.sentence = sentence
        return outcome


def plan_error(states: Float[Array, "modules 6"], goal: Goal) -> Distance:
    """Largest distance of module ends from their desired positions [m].

    Args:
        states: predicted for the plan, base frame.
        goal: as requested.

    Returns:
        NaN for a goal without positions.
    """
    is_desired = jnp.asarray(goal.position_weights) > 0.0
    distances = norm(states[:, POSITION] - goal.positions)
    largest = jnp.max(jnp.where(is_desired, distances, 0.0))
    return jnp.where(is_desired.any(), largest, jnp.nan)


def judge(outcome: Count, problem: Problem, bends: Bends) -> tuple[Count, Distance]:
    """The outcome of a plan, and its distance from the goal by its own model.

    Args:
        outcome: of the solver and the fallback search.
        problem: of this step, with the goal as requested.
        bends: planned [rad].

    Returns:
        The outcome, which is refined where the solver made the plan or the last one is
        kept, and the distance [m] (`plan_error`).
    """
    situation = problem.situation
    tolerance = REACHED * situation.length
    candidate = problem.candidate_at(bends)
    error = plan_error(candidate.states, situation.goal)
    before = plan_error(situation.last.states, situation.goal)
    reached = jnp.isnan(error) | (error <= tolerance)
    blocked = jax.lax.cond(
        reached | (before - error > tolerance),
        lambda: jnp.asarray(False),
        lambda: error * _possible_fall(problem, bends, candidate) <= tolerance,
    )
    step = largest_bend(bends - situation.last.bends)
    still = step < STILL * situation.longest_step
    solved = jnp.where(still, Outcome.STALLED, Outcome.MOVING)
    solved = jnp.where(reached, Outcome.SOLVED, solved)
    refined = jnp.where(outcome == Outcome.SOLVED, solved, outcome)
    is_refined = (outcome == Outcome.SOLVED) | (outcome == Outcome.KEPT)
    return jnp.where(is_refined & blocked, Outcome.OUT_OF_REACH, refined), error


def _possible_fall(
    problem: Problem, bends: Bends, candidate: Candidate
) -> Float[Array, ""]:
    """Share by which a step within the limits reduces the residuals' norm."""
    situation = problem.situation
    longest = situation.longest_step
    units = longest * jnp.eye(bends.size).reshape(-1, *bends.shape)

    def residuals(changes: Bends) -> Float[Array, " residuals"]:
        return problem.stacked(bends + changes)

    sides = jax.vmap(residuals)(jnp.concatenate([units, -units]))
    plus, minus = jnp.split(sides, 2)
    slopes = (plus - minus).T / (2.0 * longest)
    present = problem.residuals_of(candidate)

    def left(changes: Bends) -> Float[Array, " residuals"]:
        return present + slopes @ changes.reshape(-1)

    def project(changes: Bends) -> Bends:
        allowed = limit_lengths(bends + changes, situation.bend_limits) - bends
        return limit_lengths(allowed, longest)

    start = jnp.zeros_like(bends)
    changes, _ = solve_least_squares(left, start, project, SLOPE_ITERATIONS)
    return 1.0 - norm(left(changes)) / norm(present)
