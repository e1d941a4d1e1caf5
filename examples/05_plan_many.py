"""Plan offline: for many targets, from many starts, and along a whole path."""

import numpy as np

import s2c2a
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import BEST, BatchPlanner

arm = s2c2a.load_arm("twin_arm")
planner = BatchPlanner(arm, PCCForwardModel.of(arm), BEST)
# With trained networks: s2c2a_batch_planner(load_networks("mine.safetensors"))

rng = np.random.default_rng(0)
bent = rng.normal([0.0, 0.0, 1.0], [0.2, 0.2, 0.0], (16, arm.module_count, 3))
starts = bent / np.linalg.norm(bent, axis=-1, keepdims=True)

targets = rng.uniform([-0.2, -0.2, 0.45], [0.2, 0.2, 0.55], (16, 3))
rest = s2c2a.Goal.of(arm.module_count)
goals = s2c2a.Goal.stacked([rest.with_position(target) for target in targets])
plans = planner.plan(planner.start(starts), starts, goals)
shape = plans.configurations.shape
print(f"one step towards {len(targets)} targets: configurations of shape {shape}")

desired = rest.with_position([0.0, 0.0, 0.5]).with_axis([0.0, 0.0, 1.0])
best = planner.best(starts, desired, steps=40)
print(f"upright but low: best cost {best.value:.3f} from start {best.start},")
print(f"worst cost {best.values.max():.3f}")

angles = np.linspace(0.0, 2.0 * np.pi, 200)
circle = np.stack([0.2 * np.cos(angles), 0.2 * np.sin(angles), 0 * angles + 0.52], -1)
straight = np.tile([0.0, 0.0, 1.0], (arm.module_count, 1))
goals = s2c2a.Goal.stacked([rest.with_position(point) for point in circle])
path = planner.path(straight, goals)
errors = np.linalg.norm(path.states[50:, -1, :3] - circle[50:], axis=-1)
error = f"{100 * errors.mean():.2f} cm mean error in the model"
print(f"a circle of {len(circle)} steps in one call: {error}")
