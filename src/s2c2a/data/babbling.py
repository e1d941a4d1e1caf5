"""Random exploration of an arm: staged babbling, motor babbling, and a mixture."""

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry

Shares = Float[np.ndarray, "modules paths"]
SPEEDS = (0.03, 0.22)
"""Slowest and fastest approach of a bend target: share of the full bend per step."""


def episode_actions(
    geometry: ArmGeometry,
    babbling: str,
    episode: int,
    episodes: int,
    samples: int,
    seed: int,
    speeds: tuple[float, float] = SPEEDS,
) -> Float[np.ndarray, "samples modules cables"]:
    """Actions of one episode, from a random stream of its own.

    Args:
        geometry: geometry of the arm.
        babbling: one of `BABBLING`.
        episode: index of the episode.
        episodes: number of episodes, which the stages share evenly.
        samples: number of control steps in an episode.
        seed: seed of the whole recording.
        speeds: slowest and fastest approach of a bend target by each path, as a share
            of the full bend per step.

    Returns:
        Displacements [m] or tensions [N].
    """
    random = np.random.default_rng(np.random.SeedSequence([seed, episode]))
    shares = BABBLING[babbling](len(geometry.lengths), episode / episodes)
    paths = [bend_path(samples, random, speeds) for _ in range(shares.shape[1])]
    mixed = np.einsum("mp,spk->smk", shares, np.stack(paths, axis=1))
    bends = mixed / np.maximum(np.linalg.norm(mixed, axis=-1, keepdims=True), 1.0)
    actions = geometry.actions_at(bends)
    return np.clip(actions, geometry.action_low, geometry.action_high)


def fastest(babbling: str, modules: int, speeds: tuple[float, float]) -> float:
    """Largest change of a module's bend in a step, as a share of the full bend.

    The speeds of mixed paths add up.
    """
    path_shares = BABBLING[babbling]
    totals = [
        path_shares(modules, progress).sum(axis=1).max()
        for progress in np.linspace(0.0, 1.0, 101)
    ]
    return speeds[1] * max(totals)


def bend_path(
    samples: int, random: np.random.Generator, speeds: tuple[float, float] = SPEEDS
) -> Float[np.ndarray, "samples 2"]:
    """Random path in the unit disc: lines to uniform targets at log-uniform speeds.

    A controller trained at one speed fails at others (docs/deviations.md).
    """
    position = np.zeros(2)
    path: list[np.ndarray] = []
    while len(path) < samples:
        target = disc_point(random)
        speed = np.exp(random.uniform(*np.log(speeds)))
        steps = max(1, int(np.ceil(np.linalg.norm(target - position) / speed)))
        shares = np.arange(1, steps + 1)[:, None]
        path.extend(position + (target - position) * shares / steps)
        position = target
    return np.array(path[:samples])


def disc_point(random: np.random.Generator) -> Float[np.ndarray, "2"]:
    """Uniform random point in the unit disc."""
    radius = np.sqrt(random.uniform())
    angle = random.uniform(0, 2 * np.pi)
    return radius * np.array([np.cos(angle), np.sin(angle)])


def _staged(modules: int, progress: float) -> Shares:
    """One path for all modules, then a second for the last, then one for each.

    Source: Chen et al. 2025, fig. 3C.
    """
    if progress < 1 / 3:
        return np.ones((modules, 1))
    if progress < 2 / 3 and modules > 1:
        return np.eye(2)[[0] * (modules - 1) + [1]]
    return np.eye(modules)


def _motor(modules: int, progress: float) -> Shares:
    """One path for each module."""
    return np.eye(modules)


def _mixed(modules: int, progress: float) -> Shares:
    """Gradual change from one path for all modules to one for each."""
    shares = np.hstack(
        [np.full((modules, 1), 1.0 - progress), progress * np.eye(modules)]
    )
    return shares / np.hypot(progress, 1.0 - progress)


BABBLING = {"staged": _staged, "motor": _motor, "mixed": _mixed}
"""Babbling by name: share of each random path in each module's bend, as a function of
the number of modules and the progress of the recording in [0, 1]."""
