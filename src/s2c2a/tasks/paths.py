"""Paths below the shell of equal bends, where the arm has to make an S: square, eight, helix, star.

Numbers are for an arm of `PAPER_LENGTH`; the tasks scale with the arm. Each begins with
a way out as the circle's.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.planning import Goal
from s2c2a.tasks.circle import way_out
from s2c2a.tasks.task import PAPER_LENGTH, Path, Task

# m, m, s
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
POINTS = 5
SKIPPED = 2

Shares = Float[np.ndarray, " steps"]


def square(shares: Shares) -> Path:
    """Along the sides of a square, from a corner [m]."""
    quarters = np.arange(5) * np.pi / 2 + np.pi / 4
    return _at_height(
        _between_corners(quarters, SQUARE_SIDE / np.sqrt(2), shares), SQUARE_HEIGHT
    )


def eight(shares: Shares) -> Path:
    """Along a lying eight whose middle is on the axis, from its end at x > 0 [m] (Gerono's lemniscate)."""
    angles = 2 * np.pi * shares
    across = (
        np.stack(
            [EIGHT_LENGTH * np.cos(angles), EIGHT_WIDTH * np.sin(2 * angles)], axis=-1
        )
        / 2
    )
    return _at_height(across, EIGHT_HEIGHT)


def helix(shares: Shares) -> Path:
    """Down in turns around the axis [m]."""
    angles = 2 * np.pi * TURNS * shares
    across = HELIX_RADIUS * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return _at_height(across, HELIX_TOP + (HELIX_BOTTOM - HELIX_TOP) * shares)


def star(shares: Shares) -> Path:
    """Along the lines of a star, to every second of five points around the axis [m]."""
    points = 2 * np.pi * SKIPPED / POINTS * np.arange(POINTS + 1)
    return _at_height(_between_corners(points, STAR_RADIUS, shares), STAR_HEIGHT)


PATHS: dict[str, tuple[Callable[[Shares], Path], float]] = {
    "square": (square, SQUARE_TIME),
    "eight": (eight, EIGHT_TIME),
    "helix": (helix, TURNS * TURN_TIME),
    "star": (star, STAR_TIME),
}
"""Name -> (how much of it is done -> where the tip shall be), and how long it takes
[s]."""


def path(arm: ArmSpec, name: str) -> Task:
    """Follow one of `PATHS` with the tip. Weights mu_p = 1, mu_d = 0.5."""
    points, time = PATHS[name]
    steps = max(1, round(time * arm.control_rate))
    begin = points(np.zeros(1))[0]
    along = points(np.arange(1, steps + 1) / steps)
    desired = np.concatenate(
        [way_out(begin / PAPER_LENGTH, arm.control_rate) * PAPER_LENGTH, along]
    )
    return Task.along(
        name, arm.length / PAPER_LENGTH * desired, Goal.of(arm.module_count)
    )


def _between_corners(
    azimuths: Float[np.ndarray, " corners"], radius: float, shares: Shares
) -> np.ndarray:
    """Straight, at one speed, between corners that are equally far apart, shape (steps, 2)."""
    moments = np.linspace(0.0, 1.0, len(azimuths))
    return radius * np.stack(
        [np.interp(shares, moments, turn(azimuths)) for turn in (np.cos, np.sin)],
        axis=-1,
    )


def _at_height(across: Float[np.ndarray, "steps 2"], height: Shares | float) -> Path:
    return np.column_stack([across, np.broadcast_to(height, len(across))])
