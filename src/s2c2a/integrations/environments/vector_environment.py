"""The Gymnasium environment of many arms at once."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector.utils import batch_space

from s2c2a.errors import S2C2AError, counted
from s2c2a.integrations.environments.environment import (
    action_space,
    observation_space,
    refuse_options,
)
from s2c2a.integrations.environments.simulation import SimulationBatch
from s2c2a.integrations.environments.tasks import Family


class ArmVectorEnv(gymnasium.vector.VectorEnv):
    """Arms of one kind that advance on threads; each is as an `ArmEnv`.

    `reset(seed=s)` gives arm i the seed s + i. An arm whose episode is over begins the
    next one in the next step, where its action has no effect and its reward is zero.

    Args:
        num_envs: number of arms.
        task: name of a family of tasks (`tasks.FAMILIES`), or a class of your own.
        arm: preset, arm file, or description.
        render_mode: None; single environments render.
        options: see `SimulationBatch`.

    Raises:
        S2C2AError: see `SimulationBatch`.
    """

    metadata = {"autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        task: str | type[Family] = "Reach",
        arm: Any = "twin_arm",
        render_mode: str | None = None,
        **options: Any,
    ):
        if render_mode is not None:
            raise S2C2AError("many arms have no picture; make one environment for it")
        self.batch = SimulationBatch(task, arm, num_envs, **options)
        self.num_envs = num_envs
        self.single_action_space = action_space(self.batch)
        self.single_observation_space = observation_space(self.batch)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._randoms = [np_random()[0] for _ in range(num_envs)]
        self._over = np.zeros(num_envs, bool)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict | None = None,
    ):
        """See `gymnasium.vector.VectorEnv.reset`."""
        refuse_options(options)
        if seed is not None:
            self._randoms = [np_random(each)[0] for each in self._seeds(seed)]
        self._over[:] = False
        numbers = range(self.num_envs)
        self.batch.reset(numbers, self._randoms, new_robots=seed is not None)
        return self.batch.observations(), {}

    def _seeds(self, seed: int | Sequence[int | None]) -> Sequence[int | None]:
        """The seed of each arm."""
        if isinstance(seed, Sequence):
            if len(seed) != self.num_envs:
                raise S2C2AError(
                    f"{counted(len(seed), 'seed')} for {self.num_envs} environments; give "
                    "one for each, or a single one for all"
                )
            return seed
        return [seed + number for number in range(self.num_envs)]

    def step(self, actions):
        """See `gymnasium.vector.VectorEnv.step`."""
        outcome = self.batch.step(actions)
        was_over = self._over
        terminated = outcome.terminated & ~was_over
        truncated = outcome.truncated & ~was_over
        rewards = np.where(was_over, 0.0, outcome.rewards)
        info = {"error": outcome.errors, "_error": ~was_over}
        self._over = terminated | truncated
        observations = outcome.observations
        if was_over.any():
            numbers = np.flatnonzero(was_over)
            randoms = [self._randoms[number] for number in numbers]
            self.batch.reset(numbers.tolist(), randoms, new_robots=False)
            observations = self.batch.observations()
        return observations, rewards, terminated, truncated, info

    def close_extras(self, **kwargs: Any):
        """See `gymnasium.vector.VectorEnv.close_extras`."""
        self.batch.close()
