"""Plan offline: towards many targets, and from many starts towards one."""

import jax
import numpy as np

import s2c2a
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import BEST, Step

arm = s2c2a.load_arm("twin_arm")
model = PCCForwardModel.of(arm)
step = Step.of(arm, model, BEST)  # of a trained strategy: strategy.planner.step
start = jax.jit(jax.vmap(step.started))
advance = jax.jit(jax.vmap(step.next_plan))

rng = np.random.default_rng(0)
bent = rng.normal([0.0, 0.0, 1.0], [0.2, 0.2, 0.0], (16, arm.module_count, 3))
starts = np.float32(bent / np.linalg.norm(bent, axis=-1, keepdims=True))

targets = rng.uniform([-0.2, -0.2, 0.45], [0.2, 0.2, 0.55], (16, 3))
rest = s2c2a.Goal.of(arm.module_count).with_rows(slice(0))  # without obstacles
goals = s2c2a.Goal.stacked([rest.with_position(target) for target in targets])
plans = advance(start(starts), starts, goals)
shape = plans.configurations.shape
print(f"one step towards {len(targets)} targets: configurations of shape {shape}")

target = np.array([0.15, 0.1, 0.52])
goals = s2c2a.Goal.stacked([rest.with_position(target)] * len(starts))
plans = start(starts)
for _ in range(40):
    plans = advance(plans, plans.configurations, goals)
tips = model.predict(plans.configurations, plans.memory)[:, -1, :3]
errors = 100 * np.linalg.norm(tips - target, axis=-1)
print(f"one target from {len(starts)} starts: {errors.max():.2f} cm from it at most")
