"""From what the driver asks for to the goal of a control step, and what came of it."""

import numpy as np
from jaxtyping import Float

from s2c2a.evaluation.metrics import clearances
from s2c2a.goals import Goal
from s2c2a.live.request import Request

POSITION, AXIS, OBSTACLE, CHANGE = 1.0, 2.0, 1.0, 0.5
"""The protocol's weights mu_p, mu_o, mu_ob and mu_d of a dragged target."""


def goal_of(request: Request, modules: int, task_goal: Goal | None) -> Goal:
    """The goal of one control step: the task's, or the target's, with the driver's obstacles and weights."""
    goal = Goal.of(modules, CHANGE) if task_goal is None else task_goal
    if task_goal is None and request.target is not None:
        goal = goal.with_position(request.target, POSITION)
    if task_goal is None and request.axis is not None:
        goal = goal.with_axis(request.axis, AXIS)
    factors = request.weights
    goal = goal._replace(
        position_weights=np.float32(factors.position) * goal.position_weights,
        axis_weights=np.float32(factors.axis) * goal.axis_weights,
        change_weight=np.float32(factors.change) * goal.change_weight,
    )
    own = np.asarray(goal.thresholds) > 0
    centres = [*np.asarray(goal.obstacles)[own], *(one.centre for one in request.obstacles)]
    thresholds = [*np.asarray(goal.thresholds)[own], *(one.threshold for one in request.obstacles)]
    return goal.with_obstacles(np.reshape(centres, (-1, 3)), thresholds, float(factors.obstacle * goal.obstacle_weight))


def judged(goal: Goal, tip: Float[np.ndarray, "3"]) -> tuple[float, float]:
    """How far the tip is from where the goal wants it, and least from a threshold [m]; NaN and infinite without."""
    asked = float(np.asarray(goal.position_weights)[-1]) > 0
    error = float(np.linalg.norm(tip - np.asarray(goal.positions[-1]))) if asked else float("nan")
    spheres = np.column_stack([goal.obstacles, goal.thresholds])[None]
    return error, float(clearances(tip[None, None], spheres)[0]) / 100.0
