"""Goals that jump, many of them out of reach."""

import numpy as np

from s2c2a.planning import Goal


def jumping_goals(seed, count, modules=3):
    """Goals that jump every 20 steps, many of them out of reach."""
    random = np.random.default_rng(seed)
    goals = []
    for _ in range(count // 20):
        goal = Goal.of(modules, change_weight=random.uniform(0, 0.5)).with_position(
            random.uniform(-0.5, 0.5, 3)
        )
        goal = goal.with_axis(random.normal(size=3), weight=1.0).with_axis(
            random.normal(size=3), 1.0, module=0
        )
        goals += [
            goal.with_obstacles(
                random.uniform(-0.2, 0.6, (2, 3)), random.uniform(0.05, 0.3, 2)
            )
        ] * 20
    return goals
