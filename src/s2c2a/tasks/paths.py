"""Paths that need S-shaped arms: square, eight, helix and star.

They lie below the surface that the tip reaches with equal bends. Lengths are for an arm
of `PAPER_LENGTH`, and scale with the arm. Each path begins with an approach like that
of the circle.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.planning import Goal
from s2c2a.tasks.circle import approach_path
from s2c2a.tasks.task import PAPER_LENGTH, Path, Task

# lengths in m, times in s
SQUARE_SIDE = 0.24
SQUARE_HEIGHT = 0.54
SQUARE_TIME = 16.0
EIGHT_LENGTH = 0.36
EIGHT_WIDTH = 0.18
EIGHT_HEIGHT = 0.55
EIGHT_TIME = 20.0
HELIX_RADIUS = 0.15
HELIX_TOP = 0.57
HELIX_BOTTOM = 0.54
TURNS = 2
TURN_TIME = 12.0
STAR_RADIUS = 0.16
STAR_HEIGHT = 0.57
STAR_TIME = 20.0
STAR_POINTS = 5
STAR_STRIDE = 2  # each line connects a point with the second next one

Shares = Float[np.ndarray, " steps"]


def square(shares: Shares) -> Path:
    """Square, from a corner [m]."""
    azimuths = np.arange(5) * np.pi / 2 + np.pi / 4
    corners = _between_corners(azimuths, SQUARE_SIDE / np.sqrt(2), shares)
    return _at_height(corners, SQUARE_HEIGHT)


def eight(shares: Shares) -> Path:
    """Figure of eight around the axis, from its end at x > 0 [m].

    It is Gerono's lemniscate.
    """
    angles = 2 * np.pi * shares
    x = EIGHT_LENGTH * np.cos(angles) / 2
    y = EIGHT_WIDTH * np.sin(2 * angles) / 2
    return _at_height(np.stack([x, y], axis=-1), EIGHT_HEIGHT)


def helix(shares: Shares) -> Path:
    """Descending helix around the axis [m]."""
    angles = 2 * np.pi * TURNS * shares
    lateral = HELIX_RADIUS * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return _at_height(lateral, HELIX_TOP + (HELIX_BOTTOM - HELIX_TOP) * shares)


def star(shares: Shares) -> Path:
    """Five-pointed star around the axis [m]."""
    azimuths = 2 * np.pi * STAR_STRIDE / STAR_POINTS * np.arange(STAR_POINTS + 1)
    return _at_height(_between_corners(azimuths, STAR_RADIUS, shares), STAR_HEIGHT)


PATHS: dict[str, tuple[Callable[[Shares], Path], float]] = {
    "square": (square, SQUARE_TIME),
    "eight": (eight, EIGHT_TIME),
    "helix": (helix, TURNS * TURN_TIME),
    "star": (star, STAR_TIME),
}
"""Name -> function from path parameters (0 to 1) to tip positions, and duration [s]."""


def path(arm: ArmSpec, name: str) -> Task:
    """Follow one of `PATHS` with the tip. Weights: mu_p = 1, mu_d = 0.5."""
    points, time = PATHS[name]
    steps = max(1, round(time * arm.control_rate))
    start = points(np.zeros(1))[0]
    approach = approach_path(start / PAPER_LENGTH, arm.control_rate) * PAPER_LENGTH
    desired = np.concatenate([approach, points(np.arange(1, steps + 1) / steps)])
    scale = arm.length / PAPER_LENGTH
    return Task.along(name, scale * desired, Goal.of(arm.module_count))


def _between_corners(
    azimuths: Float[np.ndarray, " corners"], radius: float, shares: Shares
) -> Float[np.ndarray, "steps 2"]:
    """Lateral positions on a closed polygon with equal sides, at constant speed."""
    corner_shares = np.linspace(0.0, 1.0, len(azimuths))
    x = np.interp(shares, corner_shares, np.cos(azimuths))
    y = np.interp(shares, corner_shares, np.sin(azimuths))
    return radius * np.stack([x, y], axis=-1)


def _at_height(lateral: Float[np.ndarray, "steps 2"], height: Shares | float) -> Path:
    return np.column_stack([lateral, np.broadcast_to(height, len(lateral))])
