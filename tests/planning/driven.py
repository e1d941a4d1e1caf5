"""Plans of an arm that follows them exactly, and goals that jump."""

import jax
import numpy as np

from s2c2a.arm import load_arm
from s2c2a.estimation import Estimate
from s2c2a.kinematics import bends_from_configurations, states_from_configurations
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import Goal

TWIN = load_arm("twin_arm")
MODEL = PCCForwardModel.of(TWIN)
STRAIGHT = np.tile(np.float32([0.0, 0.0, 1.0]), (3, 1))
states_of = jax.jit(
    lambda planned: states_from_configurations(planned, np.full(3, 0.2, np.float32))
)
bends_of = jax.jit(bends_from_configurations)


def driven(planner, goals, start=STRAIGHT):
    """All plans for an arm that follows them exactly, and their configurations."""
    plans = [planner.start(Estimate(start))]
    for goal in goals:
        plans.append(planner.plan(plans[-1], Estimate(plans[-1].configurations), goal))
    return plans[1:], np.array([plan.configurations for plan in plans])


def tips_of(planned):
    """Places of the tip [m] after the start, shape (steps, 3)."""
    return np.asarray(states_of(planned))[1:, -1, :3]


def jumping_goals(seed, count, modules=3):
    """Goals that jump every 20 steps, many of them out of reach."""
    random = np.random.default_rng(seed)
    goals = []
    for _ in range(count // 20):
        goal = Goal.of(modules, change_weight=random.uniform(0, 0.5))
        goal = goal.with_position(random.uniform(-0.5, 0.5, 3))
        goal = goal.with_axis(random.normal(size=3), weight=1.0)
        goal = goal.with_axis(random.normal(size=3), 1.0, module=0)
        centers = random.uniform(-0.2, 0.6, (2, 3))
        thresholds = random.uniform(0.05, 0.3, 2)
        goals += [goal.with_obstacles(centers, thresholds)] * 20
    return goals
