"""Random actions that explore an arm: staged as in the paper, or plain motor babbling."""

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry

SPEEDS = (0.03, 0.22)
"""Slowest and fastest approach of a bend target, as part of the full bend per step."""


def episode_actions(
    geometry: ArmGeometry,
    babbling: str,
    episode: int,
    episodes: int,
    samples: int,
    seed: int,
    speeds: tuple[float, float] = SPEEDS,
) -> Float[np.ndarray, "samples modules cables"]:
    """Actions of one episode; each episode has its own random stream, whoever collects it and when.

    Args:
        geometry: of the arm.
        babbling: one of `BABBLING`.
        episode: number of the episode, from zero.
        episodes: how many there are; the stages share them evenly.
        samples: control steps in an episode.
        seed: of the whole recording.
        speeds: slowest and fastest approach of a bend target, as part of the full bend per step.

    Returns:
        Displacements [m] or tensions [N].
    """
    random = np.random.default_rng(np.random.SeedSequence([seed, episode]))
    groups = BABBLING[babbling](len(geometry.lengths), episode / episodes)
    paths = np.stack([bend_path(samples, random, speeds) for _ in range(max(groups) + 1)], axis=1)
    return np.clip(geometry.actions_at(paths[:, groups]), geometry.action_low, geometry.action_high)


def bend_path(
    samples: int, random: np.random.Generator, speeds: tuple[float, float] = SPEEDS
) -> Float[np.ndarray, "samples 2"]:
    """A random walk in the unit disc: straight lines to uniform targets, each at a speed of its own.

    Speeds are mixed, and log-uniform: a controller trained on one speed fails at others (docs/deviations.md).
    """
    position = np.zeros(2)
    path: list[np.ndarray] = []
    while len(path) < samples:
        target, speed = disc_point(random), np.exp(random.uniform(*np.log(speeds)))
        steps = max(1, int(np.ceil(np.linalg.norm(target - position) / speed)))
        path.extend(position + (target - position) * np.arange(1, steps + 1)[:, None] / steps)
        position = target
    return np.array(path[:samples])


def disc_point(random: np.random.Generator) -> Float[np.ndarray, "2"]:
    """A point uniform in the unit disc."""
    radius, angle = np.sqrt(random.uniform()), random.uniform(0, 2 * np.pi)
    return radius * np.array([np.cos(angle), np.sin(angle)])


def _staged(modules: int, progress: float) -> list[int]:
    """Which random path each module follows: one for all; the end apart; each its own (Chen et al. 2025, fig. 3C)."""
    if progress < 1 / 3:
        return [0] * modules
    if progress < 2 / 3:
        return [0] * (modules - 1) + [1 if modules > 1 else 0]
    return list(range(modules))


def _motor(modules: int, progress: float) -> list[int]:
    """Every module its own path, all along."""
    return list(range(modules))


BABBLING = {"staged": _staged, "motor": _motor}
"""Ways to babble: name -> which path each module follows at a given progress through the recording."""
