"""The planner's objective, built here and solved elsewhere."""

from collections.abc import Callable

from jaxtyping import Array, Float

from s2c2a.kinematics import ForwardModel
from s2c2a.kinematics.forward_model import Memory
from s2c2a.planning.goal import Goal
from s2c2a.planning.guard import GuardedPoints
from s2c2a.planning.losses import change_loss, obstacle_loss, target_loss
from s2c2a.spaces import AXIS, POSITION

Objective = Callable[[Float[Array, "modules 3"]], Float[Array, ""]]


def objective(
    model: ForwardModel,
    memory: Memory,
    goal: Goal,
    last: Float[Array, "modules 3"],
    length_scale: float,
    guarded: GuardedPoints,
) -> Objective:
    """mu_p L_p + mu_o L_o + mu_ob L_ob + mu_d L_d as a function of configurations (Chen et al. 2025, eq. (7)).

    Args:
        model: predicts states.
        memory: of the model.
        goal: targets, obstacles, weights.
        last: C_0, the last configuration.
        length_scale: what a length of one stands for [m].
        guarded: states -> points that keep out of obstacles.
    """

    def value(configurations: Float[Array, "modules 3"]) -> Float[Array, ""]:
        states = model.predict(configurations, memory)
        positions, axes = states[:, POSITION] / length_scale, states[:, AXIS]
        return (
            target_loss(positions, goal.positions / length_scale, goal.position_weights)
            + target_loss(axes, goal.axes, goal.axis_weights)
            + goal.obstacle_weight
            * obstacle_loss(
                guarded(states) / length_scale, goal.obstacles / length_scale, goal.thresholds / length_scale
            )
            + goal.change_weight * change_loss(configurations, last)
        )

    return value
