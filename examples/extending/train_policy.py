"""Train a policy by reinforcement learning (SAC), and save it as a strategy.

    pip install "s2c2a[gym]" torch stable-baselines3
    python train_policy.py Reach policy.safetensors --minutes 30
    s2c2a run circle --strategy policy --weights policy.safetensors

It prints the mean error in the last second of each goal (`Reach`), or after the first
four seconds, on goals that training does not see.
"""

import argparse
import time

import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import BaseCallback

from s2c2a.integrations.environments.stable_baselines3 import ArmVecEnv, export_policy

parser = argparse.ArgumentParser()
parser.add_argument("task", choices=["Reach", "Track", "Follow", "Hold"])
parser.add_argument("out")
parser.add_argument("--arm", default="twin_arm")
parser.add_argument("--minutes", type=float, default=30.0)
parser.add_argument("--randomization", type=float, default=0.0)
parser.add_argument("--seed", type=int, default=0)
given = parser.parse_args()

torch.set_num_threads(1)  # the arms have the other cores
options = {"arm": given.arm, "randomization": given.randomization}
arms = ArmVecEnv(given.task, 8, given.seed, **options)
others = ArmVecEnv(given.task, 8, given.seed + 100_000, **options)


def mean_error(model):
    """Mean error [m] of one episode of eight arms."""
    observations = others.reset()
    errors = []
    for _ in range(others.batch.family.steps - 1):
        actions, _ = model.predict(observations, deterministic=True)
        observations, _, _, infos = others.step(actions)
        errors.append([info["error"] for info in infos])
    rate = others.batch.arm.control_rate
    times = np.arange(1, len(errors) + 1) / rate
    counted = times % 4.0 >= 3.0 if given.task == "Reach" else times > 4.0
    return np.mean(np.array(errors)[counted])


class Progress(BaseCallback):
    """Prints the error every minute and ends the training."""

    begin = time.monotonic()
    last = 0.0

    def _on_step(self):
        seconds = time.monotonic() - self.begin
        if seconds > self.last + 60.0:
            self.last = seconds
            error = 100 * mean_error(self.model)
            print(f"{seconds:5.0f} s, {self.num_timesteps} steps: {error:.2f} cm")
            export_policy(self.model, given.out, arms.batch.arm, overwrite=True)
        return seconds < 60.0 * given.minutes


model = SAC(
    "MlpPolicy",
    arms,
    learning_rate=1e-3,
    gamma=0.85,  # a second ahead is enough where the reward is the distance itself
    tau=0.02,
    learning_starts=1000,
    train_freq=1,
    gradient_steps=2,
    policy_kwargs={"net_arch": [128, 128]},
    seed=given.seed,
    device="cpu",
)
model.learn(10**9, callback=Progress())
print(f"at the end: {100 * mean_error(model):.2f} cm")
export_policy(model, given.out, arms.batch.arm, overwrite=True)
