"""Train a policy, first by imitation and then by reinforcement learning (PPO).

    pip install "s2c2a[gym]" torch stable-baselines3
    python train_policy.py policy.safetensors Reach Track --minutes 5
    s2c2a run circle --strategy policy --weights policy.safetensors

The teacher is `JacobianPolicy`, which knows arcs of constant curvature alone. Its actions
are labels of the moments that the learner meets (Ross et al. 2011, DAgger), in each task
in turn. PPO then improves the policy in the first task, and the best one is saved.

It prints the mean error in the last second of each goal (`Reach`), or after the first
four seconds, for each task, on goals that training does not see: those that choose the
best policy, and at the end others.
"""

import argparse
import time
from copy import deepcopy

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from s2c2a.integrations.environments.jacobian_policy import JacobianPolicy
from s2c2a.integrations.environments.stable_baselines3 import ArmVecEnv, export_policy

parser = argparse.ArgumentParser()
parser.add_argument("out")
parser.add_argument("tasks", nargs="+", choices=["Reach", "Track", "Follow", "Hold"])
parser.add_argument("--arm", default="twin_arm")
parser.add_argument("--minutes", type=float, default=5.0)
parser.add_argument("--rounds", type=int, default=8, help="of imitation")
parser.add_argument("--randomization", type=float, default=0.0)
parser.add_argument("--seed", type=int, default=0)
given = parser.parse_args()

torch.set_num_threads(1)  # the arms have the other cores
options = {"arm": given.arm, "randomization": given.randomization}
lessons = [ArmVecEnv(task, 8, given.seed, **options) for task in given.tasks]
exams = {task: ArmVecEnv(task, 20, **options) for task in given.tasks}
arms = lessons[0]
begin = time.monotonic()
best, best_weights = np.inf, {}


def mean_errors(model, first_seed):
    """Mean error [m] of one episode of 20 arms in each task, seeds from this one on."""
    return np.array([mean_error(model, task, first_seed) for task in given.tasks])


def mean_error(model, task, first_seed):
    """Mean error [m] in a task."""
    others = exams[task]
    others.seed(first_seed)
    observations = others.reset()
    errors = []
    for _ in range(others.batch.family.steps - 1):
        actions, _ = model.predict(observations, deterministic=True)
        observations, _, _, infos = others.step(actions)
        errors.append([info["error"] for info in infos])
    times = np.arange(1, len(errors) + 1) / others.batch.arm.control_rate
    counted = times % 4.0 >= 3.0 if task == "Reach" else times > 4.0
    return np.mean(np.array(errors)[counted])


def report(model, phase):
    """Print the error, and save the policy if it is the best."""
    global best, best_weights
    errors = mean_errors(model, given.seed + 100_000)
    seconds = time.monotonic() - begin
    print(f"{seconds:5.0f} s, {phase}: {np.round(100 * errors, 2)} cm", flush=True)
    if errors.mean() < best:
        best = errors.mean()
        best_weights = deepcopy(model.policy.state_dict())
        export_policy(model, given.out, arms.batch.arm, overwrite=True)


def imitate(model):
    """Learn the teacher's actions where the learner goes."""
    teacher = JacobianPolicy(arms.batch.controls)
    optimizer = torch.optim.Adam(model.policy.parameters(), lr=1e-3)
    inputs, labels = [], []
    for number in range(given.rounds):
        lesson = lessons[number % len(lessons)]
        observations = lesson.reset()
        for _ in range(lesson.batch.family.steps):
            inputs.append(observations)
            labels.append(teacher.actions(observations))
            actions, _ = model.predict(observations)  # with exploration
            follows = number < len(lessons)  # the learner knows nothing at first
            observations, *_ = lesson.step(labels[-1] if follows else actions)
        seen = torch.tensor(np.concatenate(inputs))
        wanted = torch.tensor(np.concatenate(labels), dtype=torch.float32)
        for _ in range(1000):
            picked = torch.randint(len(wanted), (512,))
            means = model.policy.get_distribution(seen[picked]).mode()
            loss = torch.nn.functional.mse_loss(means, wanted[picked])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
        report(model, f"imitation {number + 1}")


class Progress(BaseCallback):
    """Reports every two minutes and ends the training."""

    last = 0.0

    def _on_step(self):
        seconds = time.monotonic() - begin
        if seconds > self.last + 120.0:
            self.last = seconds
            report(self.model, f"{self.num_timesteps} steps of PPO")
        return seconds < 60.0 * given.minutes


model = PPO(
    "MlpPolicy",
    arms,
    learning_rate=1e-4,
    n_steps=200,  # an episode of twin_arm
    batch_size=400,
    n_epochs=5,
    gamma=0.9,  # a second ahead is enough where the reward is the distance itself
    clip_range=0.1,
    policy_kwargs={"net_arch": [128, 128], "log_std_init": -2.0},
    seed=given.seed,
    device="cpu",
)
imitate(model)
model.learn(10**9, callback=Progress())
report(model, "at the end")
model.policy.load_state_dict(best_weights)
errors = mean_errors(model, given.seed + 200_000)
print(f"the best, saved, on other goals: {np.round(100 * errors, 2)} cm")
