"""Outcomes: how a control step was planned, and whether the plan reaches its goal.

A plan that has not reached its goal moves nearer, could move nearer but stands still, or
cannot move nearer. The positions that the forward model predicts for the plan decide
whether it has reached its goal. The shape decides what a further step could do: there
the arm moves as arcs do, which costs next to nothing beside the forward model.
"""

from enum import IntEnum

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from s2c2a.goals import Goal, PerModule
from s2c2a.kinematics import limit_lengths, norm, states_from_bends
from s2c2a.kinematics.bends import Numbers, Truth
from s2c2a.planning.terms import Bends, Candidate, Situation, largest_bend
from s2c2a.spaces import POSITION

SIGNIFICANT = 0.01
"""Of the arm's length: a smaller distance from the goal is not reported."""
STILL = 0.05  # of the step limit: a plan that moves less is still, in reports
DESCENT_ITERATIONS = 30  # few variables, and only a sign is asked for


class Outcome(IntEnum):
    """How a control step was planned; the value is the number in files.

    Numbers 1 to 4 are those of a search that version 0.3 had.

    Attributes:
        SOLVED: the plan is the result of the solver, and has reached its goal by the
            plan's own model, within 1 % of the arm's length.
        STALLED: the plan stands still and has not reached its goal, although a step of
            arcs within the limits gets nearer.
        OUT_OF_REACH: the plan has not reached its goal, and no step of arcs within the
            limits gets nearer.
        MOVING: the plan is the result of the solver, and moves; it has not reached its
            goal.
        BLOCKED: the plan has not reached its goal, and a search found no way there past
            the obstacles: it goes to the nearest clear point, if there is one.
        OVERLOADED: the arm has fallen from its goal under its load: the plan goes to
            rest, or to where the arm is calm before that, until the goal changes or the
            arm is there again.
        PASSING: the plan has not reached its goal, since an obstacle is on the path of
            the target: the tip passes beside it.
    """

    SOLVED = 0
    STALLED = 5
    OUT_OF_REACH = 6
    MOVING = 7
    BLOCKED = 8
    OVERLOADED = 9
    PASSING = 10


def plan_error(states: Float[Numbers, "modules 6"], goal: Goal) -> float:
    """Largest distance of module ends from their desired positions [m].

    Args:
        states: predicted for the plan, base frame (`Plan.expectation`).
        goal: as requested; outside compiled code.

    Returns:
        NaN for a goal without positions.
    """
    gaps = np.asarray(states, dtype=float)[:, POSITION] - goal.desired_positions()
    return float(np.fmax.reduce(np.linalg.norm(gaps, axis=-1)))


def judge(
    planned: Candidate, situation: Situation, lengths: PerModule
) -> Int[Array, ""]:
    """The outcome of a step.

    Args:
        planned: by the solver.
        situation: of this step, with the goal as requested.
        lengths: of the modules [m].
    """
    goal = situation.goal
    is_desired = jnp.asarray(goal.position_weights)[:, None] > 0.0
    gaps = jnp.where(is_desired, planned.states[:, POSITION] - goal.positions, 0.0)
    error = jnp.max(norm(gaps))

    def is_blocked() -> Truth:
        """Whether no step within the limits moves the ends of arcs nearer to their goal.

        Nearer is by more than a twentieth of the way of a straight arm that turns at its
        base by the step limit. Projected gradient descent solves the linear problem.
        """
        longest = situation.longest_step
        flat = gaps.reshape(-1)
        bends = planned.bends
        slopes = jnp.where(is_desired, slopes_of(bends, lengths, longest), 0.0)
        slopes = slopes.reshape(bends.size, -1)
        rate = 1.0 / jnp.maximum(jnp.sum(slopes**2), np.finfo(np.float32).tiny)

        def gaps_after(changes: Bends) -> Float[Array, " gaps"]:
            return flat + changes.reshape(-1) @ slopes

        def descend(_, changes: Bends) -> Bends:
            gradient = (slopes @ gaps_after(changes)).reshape(bends.shape)
            moved = bends + changes - rate * gradient
            allowed = limit_lengths(moved, situation.bend_limits)
            return limit_lengths(allowed - bends, longest)

        still = jnp.zeros_like(bends)
        changes = jax.lax.fori_loop(0, DESCENT_ITERATIONS, descend, still)
        fall = norm(flat) - norm(gaps_after(changes))
        return fall <= STILL * longest * situation.length

    reached = jnp.isnan(error) | (error <= SIGNIFICANT * situation.length)
    blocked = jax.lax.cond(reached, lambda: jnp.asarray(False), is_blocked)
    step = largest_bend(planned.bends - situation.last.bends)
    still = step < STILL * situation.longest_step
    solved = jnp.where(still, Outcome.STALLED, Outcome.MOVING)
    solved = jnp.where(reached, Outcome.SOLVED, solved)
    return jnp.where(blocked, Outcome.OUT_OF_REACH, solved).astype(jnp.int32)


def slopes_of(
    bends: Bends, lengths: PerModule, step: float | Array
) -> Float[Array, "variables modules 3"]:
    """Central differences of the ends of arcs [m/rad]; they compile faster than slopes."""
    units = step * jnp.eye(bends.size).reshape(-1, *bends.shape)
    moved = bends + jnp.concatenate([units, -units])
    ahead, behind = jnp.split(states_from_bends(moved, lengths)[..., POSITION], 2)
    return (ahead - behind) / (2.0 * step)
