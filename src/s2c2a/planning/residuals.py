"""The planner's objective as residuals: what a damped least-squares solver squares and sums."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.kinematics import ForwardModel, configurations_from_bends, limit_lengths
from s2c2a.kinematics.bends import squared_norm
from s2c2a.kinematics.forward_model import Memory
from s2c2a.planning.detour import FAR, Drawn, WorkspaceMap, drawn_along
from s2c2a.planning.goal import Goal
from s2c2a.planning.guard import GuardedPoints
from s2c2a.planning.losses import norm
from s2c2a.planning.options import LeastSquaresOptions
from s2c2a.spaces import AXIS, POSITION

OBSTACLES_AT_HAND = 4  # of every guarded point
SHAPE_STEP_DEG = 2.0  # of every module and step, towards a node of the map
Residuals = Callable[[Float[Array, " variables"]], Float[Array, " residuals"]]


def goal_residuals(
    model: ForwardModel,
    memory: Memory,
    goal: Goal,
    last: Float[Array, "modules 2"],
    limits: Float[Array, " modules"],
    length: float,
    guarded: GuardedPoints,
    workspace: WorkspaceMap,
    options: LeastSquaresOptions,
) -> Residuals:
    """Targets, limits, obstacles, change and evenness as a function of flat bends.

    Args:
        model: predicts states.
        memory: of the model.
        goal: targets, obstacles, weights.
        last: last planned bends [rad].
        limits: of bends [rad].
        length: of the arm [m].
        guarded: states -> points that keep out of obstacles.
        workspace: for ways round obstacles.
        options: weights.
    """
    unit = options.unit * length
    now = model.predict(configurations_from_bends(last), memory)
    drawn = _round_obstacles(goal, now[-1, POSITION], last, workspace, options)
    goal = goal._replace(positions=jnp.asarray(goal.positions).at[-1].set(drawn.position))
    wanted = _near_enough(goal, now, options.longest_pull * length)
    centres, reaches = _obstacles_at_hand(guarded(now), goal, options.margin * length)
    shape = last + limit_lengths(drawn.bends - last, np.deg2rad(SHAPE_STEP_DEG))
    root_of_weight = jnp.sqrt(goal.obstacle_weight)
    asked = (jnp.sum(goal.position_weights) + jnp.sum(goal.axis_weights) > 0.0).astype(jnp.float32)

    def residuals(flat: Float[Array, " variables"]) -> Float[Array, " residuals"]:
        bends = flat.reshape(last.shape)
        states = model.predict(configurations_from_bends(bends), memory)
        parts = [
            jnp.sqrt(goal.position_weights)[:, None] * (states[:, POSITION] - wanted) / unit,
            options.axis * jnp.sqrt(goal.axis_weights)[:, None] * (states[:, AXIS] - goal.axes),
            options.change * jnp.sqrt(goal.change_weight) * (bends - last),
            options.shape * drawn.on_the_map * (bends - shape),
            options.evenness * asked * (bends[1:] - bends[:-1]),
            options.limit * jnp.maximum(jnp.sqrt(squared_norm(bends) + 1e-9) - limits, 0.0),
            options.obstacle * root_of_weight * _depths(guarded(states), centres, reaches) / unit,
        ]
        return jnp.concatenate([part.reshape(-1) for part in parts])

    return residuals


def _round_obstacles(goal: Goal, tip, last, workspace: WorkspaceMap, options: LeastSquaresOptions) -> Drawn:
    """Where the tip is drawn: straight at its target, unless obstacles stand in between."""
    target, length = goal.positions[-1], workspace.length
    straight = Drawn(target, last, jnp.zeros(()))
    if options.longest_detour == 0:
        return straight

    def along() -> Drawn:
        return drawn_along(workspace, tip, target, goal, options.margin * length, options.longest_detour * length)

    needed = (goal.position_weights[-1] > 0.0) & (goal.thresholds > 0.0).any()
    return jax.lax.cond(needed, along, lambda: straight)


def _near_enough(goal: Goal, states: Float[Array, "modules 6"], longest: float) -> Float[Array, "modules 3"]:
    """Targets, drawn nearer where they are further away than the longest pull."""
    way = goal.positions - states[:, POSITION]
    distance = norm(way)[:, None]
    return states[:, POSITION] + way * jnp.minimum(1.0, longest / jnp.maximum(distance, 1e-6))


def _obstacles_at_hand(
    points: Float[Array, "points 3"], goal: Goal, margin: float
) -> tuple[Float[Array, "points near 3"], Float[Array, "points near"]]:
    """Of every point, the obstacles that it is deepest in or nearest to: centres [m], thresholds with margins [m].

    Points move a few centimetres in a step, so others do not count; the work of a step hardly grows with their number.
    """
    reaches = jnp.where(goal.thresholds > 0.0, goal.thresholds + margin, -FAR)
    _, nearest = jax.lax.top_k(reaches - norm(points[:, None] - goal.obstacles), OBSTACLES_AT_HAND)
    return jnp.asarray(goal.obstacles)[nearest], reaches[nearest]


def _depths(
    points: Float[Array, "points 3"], centres: Float[Array, "points near 3"], reaches: Float[Array, "points near"]
) -> Float[Array, "points near"]:
    """How far points are within the obstacles at hand [m]."""
    return jnp.maximum(reaches - norm(points[:, None] - centres), 0.0)
