"""Train a policy in a task of your own; each arm of the batch tries other weights."""

import gymnasium
import numpy as np

from s2c2a.integrations.environments.policy import save_policy
from s2c2a.integrations.environments.tasks import Reach


class Cup(Reach):
    """Bring a cup to points; it spills when the tip leans by more than 60 degrees."""

    def rewards(self, moment):
        return super().rewards(moment) - 100 * self.ends(moment)

    def ends(self, moment):
        return moment.states[:, -1, 5] < np.cos(np.deg2rad(60))


def returns(envs, weights, seeds):
    observations, _ = envs.reset(seed=seeds)
    total, going = np.zeros(len(seeds)), np.ones(len(seeds), bool)
    while going.any():
        actions = np.tanh(np.einsum("aoi,ai->ao", weights, np.tanh(observations)))
        observations, rewards, terminated, truncated, _ = envs.step(actions)
        total += going * rewards
        going &= ~(terminated | truncated)
    return total


def train(envs, generations):
    """Evolution strategies (Salimans et al. 2017), on the same episode for all arms."""
    random = np.random.default_rng(0)
    weights = np.zeros((envs.action_space.shape[1], envs.observation_space.shape[1]))
    for seed in range(generations):
        half = random.normal(size=(envs.num_envs // 2, *weights.shape))
        changes = np.concatenate([half, -half])
        found = returns(envs, weights + 0.1 * changes, [seed] * envs.num_envs)
        ranks = found.argsort().argsort() / (len(found) - 1) - 0.5
        weights = weights + 0.03 * np.tensordot(ranks, changes, 1)
    return weights


def main(file, generations=50, arms=32):
    options = {"task": Cup, "arm": "planar_finger", "seconds": 4.0}
    kind = "vector_entry_point"
    envs = gymnasium.make_vec("s2c2a:S2C2A/Task-v0", arms, kind, **options)
    for number in (0, generations):
        weights = train(envs, number)
        found = returns(envs, np.array([weights] * arms), range(1000, 1000 + arms))
        print(f"after {number} generations, the mean return is {found.mean():.1f}")
    hidden = np.eye(weights.shape[1])
    layers = [(hidden, 0 * hidden[0]), (weights, 0 * weights[:, 0])]
    save_policy(file, envs.unwrapped.batch.arm, layers, "tanh", overwrite=True)


if __name__ == "__main__":
    main("cup.safetensors")
