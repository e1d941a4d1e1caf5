"""How an arm stands in the world, and what is round it there: its plane, its base frame's names, gravity.

Points are drawn in its base frame, by cameras that stand upright.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec

# part of gravity along the arm from which on it stands or hangs; below it lies
STEEP = 0.7
View = tuple[int, int]
"""Which coordinates run to the right and upward."""
ABOVE = (0, 1)
SIDE = (0, 2)

# the plane's radius, and how far it lies below the base, in parts of the arm's length
WIDE = 0.7
LOW = 0.02
CELLS = 10.0  # about so many from the middle of the plane to its rim
# where gravity's arrow starts as `Mounting.placed` says, its length
ARROW = np.array([-0.45, -0.38, 0.35])
FALL = 0.3


@dataclass(frozen=True, eq=False)
class Mounting:
    """Which way an arm's base frame is turned in the world.

    In the world z is up and, where the arm lies, x is where it points to; without
    gravity the arm stands.

    Attributes:
        turn: rotation from the base frame to the world; its rows are the world's axes
            in the base frame.
        gravity: direction in which things fall, base frame, or zero.
        word: "stands", "hangs", "lies", or "floats" without gravity.
    """

    turn: Float[np.ndarray, "3 3"]
    gravity: Float[np.ndarray, "3"]
    word: str

    @classmethod
    def of(cls, arm: ArmSpec) -> "Mounting":
        """The mounting that an arm's gravity says."""
        gravity = np.array(arm.gravity_direction, float)
        up = (
            -gravity / np.linalg.norm(gravity)
            if gravity.any()
            else np.array([0.0, 0.0, 1.0])
        )
        lies = abs(up[2]) < STEEP
        ahead = np.array([0.0, 0.0, 1.0] if lies else [1.0, 0.0, 0.0])
        ahead = ahead - (ahead @ up) * up
        ahead = ahead / np.linalg.norm(ahead)
        word = "lies" if lies else "stands" if up[2] > 0 else "hangs"
        return cls(
            np.stack([ahead, np.cross(up, ahead), up]),
            gravity,
            word if gravity.any() else "floats",
        )

    def placed(self, point) -> Float[np.ndarray, "3"]:
        """A point round a standing arm of length one, such as a camera's, as it serves this arm; base frame.

        What is above a standing arm's base is as far below a hanging one's; a lying
        arm's middle is where a standing arm's is.
        """
        x, y, z = point
        moved = {"hangs": (x, y, -z), "lies": (x + 0.5, y, z - 0.5)}.get(
            self.word, (x, y, z)
        )
        return moved @ self.turn

    def flat(self, view: View) -> tuple[View, tuple[bool, bool]]:
        """The base frame's axes nearest to the world's, for drawings of two axes, and which of them run backward."""
        axes = {0 if self.word == "lies" else 2: 2}
        for world in {0, 1, 2} - set(axes):
            axes[world] = max(
                {0, 1, 2} - set(axes.values()),
                key=lambda axis: abs(self.turn[world, axis]),
            )
        right, up = view
        return (axes[right], axes[up]), (
            self.turn[right, axes[right]] < 0,
            self.turn[up, axes[up]] < 0,
        )


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Numbers of the base frame [m]; a mounted arm's plane is its floor, ceiling or wall.

    Attributes:
        mounting: how the arm stands in the world.
        spacing: of the grid's lines: 1, 2 or 5 times a power of ten.
        radius: of the grid.
        level: height of the plane in the base frame, below its origin.
        grid: ends of its lines, from rim to rim of a disc, along y and then along x.
        names: of the axes in the plane, and where they are written.
        arrow: tail and tip of gravity's; none where the arm rises from what it is
            mounted on.
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
        mounting = Mounting.of(arm)
        size = arm.length
        least = WIDE * size / CELLS
        rounds = 10.0 ** np.floor(np.log10(least)) * np.array([1, 2, 5, 10])
        spacing = float(rounds[rounds >= 0.999 * least][0])
        radius = spacing * np.ceil(WIDE * size / spacing)
        level = -LOW * size
        names = {
            "x": np.array([1.06 * radius, 0.0, level]),
            "y": np.array([0.0, 1.06 * radius, level]),
        }
        fall = size * (mounting.placed(ARROW) + np.outer([0.0, FALL], mounting.gravity))
        places = spacing * np.arange(
            1 - round(radius / spacing), round(radius / spacing)
        )
        rim = np.outer([-1, 1], np.sqrt(radius**2 - places**2))
        along_y = np.stack(np.broadcast_arrays(places, rim, level), axis=-1).swapaxes(
            0, 1
        )
        grid = np.concatenate([along_y, along_y[..., [1, 0, 2]]])
        return cls(
            mounting,
            spacing,
            radius,
            level,
            grid,
            names,
            None if mounting.word in ("stands", "floats") else fall,
        )
