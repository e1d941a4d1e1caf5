"""Paths that need S-shaped arms: square, eight, helix and star.

They lie below the surface that the tip reaches with equal bends. Lengths are for an arm
of `PAPER_LENGTH`, and scale with the arm. Each path begins with an approach like that
of the circle.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import directions_at, interpolated
from s2c2a.planning import Goal
from s2c2a.tasks.circle import approach_path
from s2c2a.tasks.task import PAPER_LENGTH, Path, Task

Shares = Float[np.ndarray, " steps"]


def square(shares: Shares) -> Path:
    """Square with sides of 0.24 m at a height of 0.54 m, from a corner [m]."""
    azimuths = np.arange(5) * np.pi / 2 + np.pi / 4
    return _at_height(_between_corners(azimuths, 0.24 / np.sqrt(2), shares), 0.54)


def eight(shares: Shares) -> Path:
    """Figure of eight around the axis, from its end at x > 0 [m].

    It is Gerono's lemniscate, 0.36 m long and 0.18 m wide, at a height of 0.55 m.
    """
    angles = 2 * np.pi * shares
    x = 0.36 * np.cos(angles) / 2
    y = 0.18 * np.sin(2 * angles) / 2
    return _at_height(np.stack([x, y], axis=-1), 0.55)


def helix(shares: Shares) -> Path:
    """Helix of two turns and a radius of 0.15 m, from 0.57 m down to 0.54 m [m]."""
    angles = 2 * np.pi * 2 * shares
    return _at_height(0.15 * directions_at(angles), 0.57 + (0.54 - 0.57) * shares)


def star(shares: Shares) -> Path:
    """Star of five points on a circle of 0.16 m at a height of 0.57 m [m].

    Each line connects a point with the second next one.
    """
    azimuths = 2 * np.pi * 2 / 5 * np.arange(6)
    return _at_height(_between_corners(azimuths, 0.16, shares), 0.57)


PATHS: dict[str, tuple[Callable[[Shares], Path], float]] = {
    "square": (square, 16.0),
    "eight": (eight, 20.0),
    "helix": (helix, 24.0),
    "star": (star, 20.0),
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
    return radius * interpolated(shares, corner_shares, directions_at(azimuths))


def _at_height(lateral: Float[np.ndarray, "steps 2"], height: Shares | float) -> Path:
    return np.column_stack([lateral, np.broadcast_to(height, len(lateral))])
