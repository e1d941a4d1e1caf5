"""What is round an arm in films and on pages: the plane that it is mounted on, its base frame's names, gravity."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.viz.mounting import Mounting

WIDE, LOW = 0.7, 0.02  # the plane's radius, and how far it lies below the base, in parts of the arm's length
CELLS = 10.0  # about so many from the middle of the plane to its rim
ARROW, FALL = np.array([-0.45, -0.38, 0.35]), 0.3  # where gravity's arrow starts as `Mounting.placed` says, its length


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Numbers of the base frame [m]; a mounted arm's plane is its floor, ceiling or wall.

    Attributes:
        mounting: how the arm stands in the world.
        spacing: of the grid's lines.
        radius: of the grid.
        level: height of the plane in the base frame, below its origin.
        grid: ends of its lines.
        names: of the axes in the plane, and where they are written.
        arrow: tail and tip of gravity's; none where the arm stands.
    """

    mounting: Mounting
    spacing: float
    radius: float
    level: float
    grid: Float[np.ndarray, "lines 2 3"]
    names: dict[str, Float[np.ndarray, "3"]]
    arrow: Float[np.ndarray, "2 3"] | None

    @classmethod
    def of(cls, arm: ArmSpec) -> "Surroundings":
        """What is round an arm."""
        mounting, size = Mounting.of(arm), arm.length
        spacing = _round_above(WIDE * size / CELLS)
        radius = spacing * np.ceil(WIDE * size / spacing)
        level = -LOW * size
        names = {"x": np.array([1.06 * radius, 0.0, level]), "y": np.array([0.0, 1.06 * radius, level])}
        fall = size * (mounting.placed(ARROW) + np.outer([0.0, FALL], mounting.gravity))
        grid = _grid(spacing, radius, level)
        return cls(mounting, spacing, radius, level, grid, names, None if mounting.upright else fall)


def _grid(spacing: float, radius: float, level: float) -> Float[np.ndarray, "lines 2 3"]:
    """Lines along y, then along x, from rim to rim of a disc."""
    places = spacing * np.arange(1 - round(radius / spacing), round(radius / spacing))
    halves = np.sqrt(radius**2 - places**2)
    ends = [np.stack([places, side * halves, np.full_like(places, level)], axis=-1) for side in (-1, 1)]
    along_y = np.stack(ends, axis=1)
    return np.concatenate([along_y, along_y[..., [1, 0, 2]]])


def _round_above(value: float) -> float:
    """The round number (1, 2 or 5 times a power of ten) nearest above."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(step * power for step in (1, 2, 5, 10) if step * power >= 0.999 * value))
