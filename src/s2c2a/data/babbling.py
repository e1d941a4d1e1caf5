"""Random actions that explore an arm: staged as in the paper, plain motor babbling, or everything between."""

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry

Shares = Float[np.ndarray, "modules paths"]
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
        speeds: slowest and fastest approach of a bend target by each path, as part of
            the full bend per step.

    Returns:
        Displacements [m] or tensions [N].
    """
    random = np.random.default_rng(np.random.SeedSequence([seed, episode]))
    shares = BABBLING[babbling](len(geometry.lengths), episode / episodes)
    paths = np.stack(
        [bend_path(samples, random, speeds) for _ in range(shares.shape[1])], axis=1
    )
    mixed = np.einsum("mp,spk->smk", shares, paths)
    bends = mixed / np.maximum(np.linalg.norm(mixed, axis=-1, keepdims=True), 1.0)
    return np.clip(
        geometry.actions_at(bends), geometry.action_low, geometry.action_high
    )


def fastest(babbling: str, modules: int, speeds: tuple[float, float]) -> float:
    """Largest change of a module's bend in a step, as part of the full bend: where paths are mixed they add up."""
    return speeds[1] * max(
        BABBLING[babbling](modules, done).sum(axis=1).max()
        for done in np.linspace(0.0, 1.0, 101)
    )


def bend_path(
    samples: int, random: np.random.Generator, speeds: tuple[float, float] = SPEEDS
) -> Float[np.ndarray, "samples 2"]:
    """A random walk in the unit disc: straight lines to uniform targets, each at a speed of its own.

    Speeds are mixed, and log-uniform: a controller trained on one speed fails at others
    (docs/deviations.md).
    """
    position = np.zeros(2)
    path: list[np.ndarray] = []
    while len(path) < samples:
        target = disc_point(random)
        speed = np.exp(random.uniform(*np.log(speeds)))
        steps = max(1, int(np.ceil(np.linalg.norm(target - position) / speed)))
        path.extend(
            position + (target - position) * np.arange(1, steps + 1)[:, None] / steps
        )
        position = target
    return np.array(path[:samples])


def disc_point(random: np.random.Generator) -> Float[np.ndarray, "2"]:
    """A point uniform in the unit disc."""
    radius = np.sqrt(random.uniform())
    angle = random.uniform(0, 2 * np.pi)
    return radius * np.array([np.cos(angle), np.sin(angle)])


def _staged(modules: int, progress: float) -> Shares:
    """One path for all; the end apart; each its own (Chen et al. 2025, fig. 3C)."""
    if progress < 1 / 3:
        return np.ones((modules, 1))
    if progress < 2 / 3 and modules > 1:
        return np.eye(2)[[0] * (modules - 1) + [1]]
    return np.eye(modules)


def _motor(modules: int, progress: float) -> Shares:
    """Every module its own path, all along."""
    return np.eye(modules)


def _mixed(modules: int, progress: float) -> Shares:
    """From one path for all to each its own, less and less of the one."""
    shares = np.hstack(
        [np.full((modules, 1), 1.0 - progress), progress * np.eye(modules)]
    )
    return shares / np.hypot(progress, 1.0 - progress)


BABBLING = {"staged": _staged, "motor": _motor, "mixed": _mixed}
"""Ways to babble: name -> what share of each random path every module follows, given
the progress in the recording."""
