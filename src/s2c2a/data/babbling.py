"""Random exploration of an arm: staged and motor babbling, and coverage."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry
from s2c2a.data.nominal_plans import nominal_plans
from s2c2a.paper import SPEEDS, Bends, disc_points, mixed_bends, staged_shares

Shares = Float[np.ndarray, "modules paths"]
# shares and times of the recordings of `best`; others are other recordings
PLANNED_SHARE = 0.67  # of the targets of coverage that are nominal plans
FULL_SHARE = 0.5  # of the independent bends that are full
SLOW_SHARE = 0.04  # of the stretches of coverage that are slow or held
# duration of these stretches: full bends that the fastest motion passes meanwhile
SLOW_TIMES = (4.0, 10.0)
SLOWDOWN = 0.2  # of the speeds, on slow stretches
HELD_SHARE = 0.5  # of the slow stretches that hold a configuration


class Exploration(NamedTuple):
    """What an episode of babbling depends on.

    Attributes:
        geometry: geometry of the arm.
        progress: of the recording, in [0, 1).
        samples: number of control steps.
        random: source of the samples.
        speeds: slowest and fastest approach of a bend target, as a share of the full
            bend per step.
    """

    geometry: ArmGeometry
    progress: float
    samples: int
    random: np.random.Generator
    speeds: tuple[float, float]


def mixed_paths(
    shares_at: Callable[[int, float], Shares], exploration: Exploration
) -> Bends:
    """Bends that mix random paths.

    Args:
        shares_at: share of each path in each module's bend, from the number of modules
            and the progress of the recording.
        exploration: of the episode.
    """
    modules = len(exploration.geometry.lengths)
    shares = shares_at(modules, exploration.progress)
    return mixed_bends(
        shares, exploration.samples, exploration.random, exploration.speeds
    )


def covering_motion(exploration: Exploration) -> Bends:
    """Motion through targets that cover the configurations of plans, with opposed bends.

    Some targets are nominal plans for random positions of the tip, the others are
    independent bends. Some stretches are slow, and others hold, so that creep shows.
    """
    geometry = exploration.geometry
    random = exploration.random
    # enough for stretches of a full bend at the highest speed; longer motions repeat
    count = 2 + int(exploration.samples * exploration.speeds[1])
    shape = (count, len(geometry.lengths))
    # many independent bends are full, as in plans for distant positions
    bends = disc_points(random, shape)
    full = bends / np.linalg.norm(bends, axis=-1, keepdims=True)
    is_full = random.uniform(size=shape) < FULL_SHARE
    independent = np.where(is_full[..., None], full, bends)
    planned = nominal_plans(geometry, count, random)
    chosen = random.uniform(size=count) < PLANNED_SHARE
    targets = np.where(chosen[:, None, None], planned, independent)
    return motion_through(targets, exploration)


def motion_through(
    targets: Float[np.ndarray, "targets modules 2"], exploration: Exploration
) -> Bends:
    """Motion from rest along straight lines to targets; all modules arrive together.

    After the last target the first one follows. A slow stretch or a hold may end before
    its target; the next stretch then leads to the next target.

    Args:
        targets: bends in shares of the full bend.
        exploration: length, speeds and random numbers of the motion.

    Returns:
        Bends in shares of the full bend.
    """
    random = exploration.random
    position = np.zeros_like(targets[0])
    pieces: list[np.ndarray] = []
    steps = 0
    while steps < exploration.samples:
        # at a log-uniform speed; a few stretches are slow or hold
        speed = np.exp(random.uniform(*np.log(exploration.speeds)))
        change = targets[len(pieces) % len(targets)] - position
        distance = float(np.linalg.norm(change, axis=-1).max())
        if random.uniform() < SLOW_SHARE:
            shortest, longest = np.array(SLOW_TIMES) / exploration.speeds[1]
            count = random.integers(max(1, round(shortest)), max(2, round(longest)))
            slow = 0.0 if random.uniform() < HELD_SHARE else SLOWDOWN * speed
            change = change * min(1.0, slow * count / max(distance, 1e-9))
        else:
            count = max(1, int(np.ceil(distance / speed)))
        shares = np.arange(1, count + 1)[:, None, None] / count
        pieces.append(position + change * shares)
        position = pieces[-1][-1]
        steps += count
    return np.concatenate(pieces)[: exploration.samples]


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
    exploration = Exploration(geometry, episode / episodes, samples, random, speeds)
    actions = geometry.actions_at(BABBLING[babbling](exploration))
    return np.clip(actions, geometry.action_low, geometry.action_high)


def _motor(modules: int, progress: float) -> Shares:
    """One path for each module."""
    return np.eye(modules)


BABBLING: dict[str, Callable[[Exploration], Bends]] = {
    "staged": partial(mixed_paths, staged_shares),
    "motor": partial(mixed_paths, _motor),
    "coverage": covering_motion,
}
"""Babbling by name: bends of an episode, in shares of the full bend."""
