"""Many arms as a vectorized environment of Stable-Baselines3."""

import os
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from gymnasium.utils.seeding import np_random

from s2c2a.arm import ArmSpec
from s2c2a.errors import StrategyError
from s2c2a.integrations.environments.environment import action_space, observation_space
from s2c2a.integrations.environments.policy import save_policy
from s2c2a.integrations.environments.simulation import SimulationBatch
from s2c2a.integrations.environments.tasks import Family
from s2c2a.integrations.extras import needs_extra

with needs_extra("gym", "training (also pip install stable-baselines3)"):
    from stable_baselines3.common.vec_env import VecEnv


class ArmVecEnv(VecEnv):
    """Arms of one kind that advance on threads, each with the seed `seed + i`.

    As Stable-Baselines3 expects it, an episode that is over restarts in the same step.

    Args:
        task: name of a family of tasks (`tasks.FAMILIES`), or a class of your own.
        count: number of arms.
        seed: of the first arm.
        arm: preset, arm file, or description.
        options: see `SimulationBatch`.
    """

    def __init__(
        self,
        task: str | type[Family] = "Reach",
        count: int = 8,
        seed: int = 0,
        arm: Any = "twin_arm",
        **options: Any,
    ):
        self.batch = SimulationBatch(task, arm, count, **options)
        spaces = observation_space(self.batch), action_space(self.batch)
        self.render_mode = None
        super().__init__(count, *spaces)
        self.seed(seed)
        self._returns = np.zeros(count)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """See `stable_baselines3.common.vec_env.VecEnv.seed`."""
        start = 0 if seed is None else seed
        seeds = [start + number for number in range(self.num_envs)]
        self._randoms = [np_random(each)[0] for each in seeds]
        self._new_robots = True
        return seeds

    def reset(self):
        """See `stable_baselines3.common.vec_env.VecEnv.reset`."""
        self.batch.reset(range(self.num_envs), self._randoms, self._new_robots)
        self._new_robots = False
        return self.batch.observations()

    def step_async(self, actions: np.ndarray) -> None:
        """See `stable_baselines3.common.vec_env.VecEnv.step_async`."""
        self._outcome = self.batch.step(actions)

    def step_wait(self):
        """See `stable_baselines3.common.vec_env.VecEnv.step_wait`."""
        outcome = self._outcome
        over = outcome.terminated | outcome.truncated
        self._returns += outcome.rewards
        infos: list[dict] = [{"error": float(error)} for error in outcome.errors]
        numbers = np.flatnonzero(over).tolist()
        for number in numbers:
            is_late = bool(outcome.truncated[number] and not outcome.terminated[number])
            infos[number] |= {
                "terminal_observation": outcome.observations[number],
                "TimeLimit.truncated": is_late,
                "episode": {
                    "r": float(self._returns[number]),
                    "l": int(self.batch.moment().steps[number]),
                },
            }
        observations = outcome.observations
        if numbers:
            self._returns[numbers] = 0.0
            randoms = [self._randoms[number] for number in numbers]
            self.batch.reset(numbers, randoms, new_robots=False)
            observations = self.batch.observations()
        return observations, outcome.rewards.astype(np.float32), over, infos

    def close(self) -> None:
        """See `stable_baselines3.common.vec_env.VecEnv.close`."""
        self.batch.close()

    def get_attr(self, attr_name, indices=None):
        """See `stable_baselines3.common.vec_env.VecEnv.get_attr`."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name, value, indices=None):
        """See `stable_baselines3.common.vec_env.VecEnv.set_attr`."""
        raise NotImplementedError("all arms share their attributes; set none")

    def env_method(self, method_name, *args, indices=None, **kwargs):
        """See `stable_baselines3.common.vec_env.VecEnv.env_method`."""
        raise NotImplementedError("the arms have no methods of their own")

    def env_is_wrapped(self, wrapper_class, indices=None):
        """See `stable_baselines3.common.vec_env.VecEnv.env_is_wrapped`."""
        return [False for _ in self._get_indices(indices)]


def export_policy(
    model: Any, path: str | os.PathLike, arm: ArmSpec, overwrite: bool = False
) -> None:
    """Write the policy of a model as a weight file (`policy.save_policy`).

    Args:
        model: SAC, TQC or PPO with `MlpPolicy`.
        path: of the file, such as "reach.safetensors".
        arm: that it was trained for.
        overwrite: whether an existing file is replaced.

    Raises:
        StrategyError: the model has no plain network, or see `save_policy`.
    """
    policy = model.policy
    actor = getattr(policy, "actor", None)
    if actor is not None and hasattr(actor, "latent_pi"):
        modules = [*actor.latent_pi, actor.mu]
        squashed = True
    elif hasattr(policy, "action_net"):
        modules = [*policy.mlp_extractor.policy_net, policy.action_net]
        squashed = False
    else:
        raise StrategyError(
            f"{type(model).__name__} has no policy that can be exported; train SAC, TQC "
            "or PPO with MlpPolicy"
        )
    names = {type(module).__name__ for module in modules}
    activation: Literal["relu", "tanh"] = "tanh" if "Tanh" in names else "relu"
    if not names <= {"Linear", "ReLU", "Tanh"} or {"ReLU", "Tanh"} <= names:
        raise StrategyError(f"the network has {names}; use ReLU or Tanh alone")
    layers = [
        (module.weight.detach().numpy(), module.bias.detach().numpy())
        for module in modules
        if type(module).__name__ == "Linear"
    ]
    seed = model.seed or 0
    save_policy(path, arm, layers, activation, squashed, seed, overwrite)
