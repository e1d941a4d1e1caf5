"""A policy that is trained by reinforcement learning in the Gymnasium environments.

It first imitates damped least squares on ideal arcs in the moments that it meets itself
(Ross et al., AISTATS 2011), then improves by PPO (Schulman et al., 2017) on the simulated
arm. It observes encoders and the seen tip; Stable-Baselines3 trains it (extra `policies`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from s2c2a.data import CollectOptions, Recording
from s2c2a.integrations.environments.jacobian_policy import JacobianPolicy
from s2c2a.integrations.environments.policy import PolicyStrategy
from s2c2a.integrations.extras import needs_extra
from s2c2a.strategies import NetworkProgress, Recipe, TrainedNetworks, load_networks

TASKS = ("Reach", "Track")  # lessons of the imitation, in turn; PPO learns the last one
ARMS = 8
BATCH = 512
FITS = 1000  # gradient steps after every lesson

LEARNING: dict[str, Any] = {
    "learning_rate": 1e-4,
    "n_steps": 200,
    "batch_size": 400,
    "n_epochs": 5,
    "gamma": 0.9,  # a second ahead is enough where the reward is the distance
    "clip_range": 0.1,
    "device": "cpu",
}
"""Arguments of PPO."""


@dataclass(frozen=True)
class ReinforcedPolicy(PolicyStrategy):
    """Imitation, then PPO, by control steps of the simulated arm and not by time.

    Attributes:
        lessons: episodes of 8 arms in the imitation.
        steps: of PPO, over all arms.
    """

    lessons: int = 8
    steps: int = 48_000
    squashed: bool = False

    name = "ppo"
    limits = PolicyStrategy.limits | {"lessons": (2, 1000), "steps": (0, 10**9)}

    def collect_options(self, recipe: Recipe, seed: int) -> CollectOptions:
        """A short recording, of which training takes the arm alone."""
        return CollectOptions(episodes=1, samples=50, seed=seed)

    def training_key(self, recipe: Recipe) -> Any:
        """See `StrategyOptions`: the recipe does not matter."""
        return repr(self)

    def train(
        self,
        recording: Recording,
        recipe: Recipe,
        seed: int,
        progress: NetworkProgress = lambda *_: None,
    ) -> TrainedNetworks:
        with needs_extra("policies", f"training '{self.name}'"):
            import torch  # noqa: PLC0415
            from stable_baselines3 import PPO  # noqa: PLC0415

            from s2c2a.integrations.environments.stable_baselines3 import (  # noqa: PLC0415
                ArmVecEnv,
                export_policy,
            )
        torch.set_num_threads(1)  # the arms have the other cores
        arm = recording.arm
        envs = [ArmVecEnv(task, ARMS, seed, arm=arm) for task in TASKS]
        network = {
            "net_arch": [self.width] * self.depth,
            "log_std_init": -2.0,
            "activation_fn": torch.nn.ReLU,
        }
        model = PPO("MlpPolicy", envs[-1], policy_kwargs=network, seed=seed, **LEARNING)
        self._imitate(model, envs, torch, progress)
        model.learn(self.steps)
        for env in envs:
            env.close()
        with TemporaryDirectory() as folder:
            path = Path(folder) / "policy.safetensors"
            export_policy(model, path, arm)
            return load_networks(path, arm)

    def _imitate(
        self, model: Any, envs: Sequence[Any], torch: Any, progress: NetworkProgress
    ) -> None:
        """Learn the teacher's actions where the learner goes."""
        teacher = JacobianPolicy(envs[0].batch.controls)
        optimizer = torch.optim.Adam(model.policy.parameters(), lr=1e-3)
        inputs: list[np.ndarray] = []
        labels: list[np.ndarray] = []
        for number in range(self.lessons):
            env = envs[number % len(envs)]
            observations = env.reset()
            for _ in range(env.batch.family.steps):
                inputs.append(observations)
                labels.append(teacher.actions(observations))
                actions, _ = model.predict(observations)  # with exploration
                knows_nothing = number < len(envs)
                observations, *_ = env.step(labels[-1] if knows_nothing else actions)
            seen = torch.tensor(np.concatenate(inputs))
            wanted = torch.tensor(np.concatenate(labels), dtype=torch.float32)
            for _ in range(FITS):
                picked = torch.randint(len(wanted), (BATCH,))
                means = model.policy.get_distribution(seen[picked]).mode()
                loss = torch.nn.functional.mse_loss(means, wanted[picked])
                optimizer.zero_grad()
                loss.backward()
                optimizer.step()
            progress("policy", number + 1, self.lessons, float(loss.detach()))
