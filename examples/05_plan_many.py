"""Plan offline: many targets at once, the best of many starts, and a whole path in one call."""

import numpy as np

from s2c2a.arm import load_arm
from s2c2a.kinematics import PCCForwardModel
from s2c2a.planning import BEST, BatchPlanner, Goal

arm = load_arm("twin_arm")
planner = BatchPlanner(arm, PCCForwardModel.of(arm), BEST)
# With trained networks: s2c2a_batch_planner(load_strategy("mine.safetensors"))

rng = np.random.default_rng(0)
bent = rng.normal([0.0, 0.0, 1.0], [0.2, 0.2, 0.0], (16, arm.module_count, 3))
starts = bent / np.linalg.norm(bent, axis=-1, keepdims=True)

targets = rng.uniform([-0.2, -0.2, 0.45], [0.2, 0.2, 0.55], (16, 3))
plans = planner.start(starts)
plans = planner.plan(
    plans,
    starts,
    Goal.stacked([Goal.of(arm.module_count).with_position(t) for t in targets]),
)
print(
    f"one step towards {len(targets)} targets: configurations of shape {plans.configurations.shape}"
)

desired = (
    Goal.of(arm.module_count).with_position([0.0, 0.0, 0.5]).with_axis([0.0, 0.0, 1.0])
)
best = planner.best(starts, desired, steps=40)
print(
    f"upright but low: start {best.start} ends best, {best.value:.3f} against {best.values.max():.3f} at worst"
)

angles = np.linspace(0.0, 2.0 * np.pi, 200)
circle = [
    Goal.of(arm.module_count).with_position([0.2 * np.cos(a), 0.2 * np.sin(a), 0.52])
    for a in angles
]
path = planner.path(
    np.tile([0.0, 0.0, 1.0], (arm.module_count, 1)), Goal.stacked(circle)
)
missed = np.linalg.norm(
    path.states[50:, -1, :3] - [goal.positions[-1] for goal in circle[50:]], axis=-1
)
print(
    f"a circle of {len(circle)} steps in one call: {100 * missed.mean():.2f} cm off in the model"
)
