"""The planner's objective as residuals: what a damped least-squares solver squares and sums."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.kinematics import ForwardModel, configurations_from_bends, limit_lengths
from s2c2a.kinematics.bends import squared_norm
from s2c2a.kinematics.forward_model import Memory
from s2c2a.planning.detour import Drawn, WorkspaceMap, drawn_along
from s2c2a.planning.goal import Goal
from s2c2a.planning.guard import GuardedPoints
from s2c2a.planning.losses import norm
from s2c2a.planning.options import LeastSquaresOptions
from s2c2a.spaces import AXIS, POSITION

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
    shape = last + limit_lengths(drawn.bends - last, np.deg2rad(SHAPE_STEP_DEG))
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
            _within(guarded(states), goal, options.margin * length) * options.obstacle / unit,
        ]
        return jnp.concatenate([part.reshape(-1) for part in parts])

    return residuals


def _round_obstacles(goal: Goal, tip, last, workspace: WorkspaceMap, options: LeastSquaresOptions) -> Drawn:
    """Where the tip is drawn: straight at its target, unless obstacles stand in between."""
    target, length = goal.positions[-1], workspace.length

    def along() -> Drawn:
        return drawn_along(workspace, tip, target, goal, options.margin * length, options.longest_detour * length)

    needed = (goal.position_weights[-1] > 0.0) & (goal.thresholds > 0.0).any()
    return jax.lax.cond(needed, along, lambda: Drawn(target, last, jnp.zeros(())))


def _near_enough(goal: Goal, states: Float[Array, "modules 6"], longest: float) -> Float[Array, "modules 3"]:
    """Targets, drawn nearer where they are further away than the longest pull."""
    way = goal.positions - states[:, POSITION]
    distance = norm(way)[:, None]
    return states[:, POSITION] + way * jnp.minimum(1.0, longest / jnp.maximum(distance, 1e-6))


def _within(points: Float[Array, "points 3"], goal: Goal, margin: float) -> Float[Array, "points obstacles"]:
    """How far points are within thresholds and margins [m], times the root of mu_ob."""
    distances = norm(points[:, None] - goal.obstacles)
    depth = jnp.maximum(goal.thresholds + margin - distances, 0.0)
    return jnp.where(goal.thresholds > 0.0, depth, 0.0) * jnp.sqrt(goal.obstacle_weight)
