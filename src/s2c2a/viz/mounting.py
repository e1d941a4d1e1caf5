"""Orientation of an arm in the world, its ground plane and gravity arrow.

All points are in the arm's base frame; cameras stay upright in the world.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.arm import ArmSpec
from s2c2a.viz.arrays import Point, Points

# An arm stands or hangs if this share of gravity acts along its axis, else it lies.
STEEP = 0.7
View = tuple[int, int]
"""Coordinates that run to the right and upward."""
ABOVE = (0, 1)
SIDE = (0, 2)

# of the camera, what it looks at, and the light: see `Mounting.placed`
EYE = (1.75, -1.85, 1.2)
LOOK_AT = (0.12, 0.1, 0.55)
SUN = (1.0, -1.4, 2.0)

# ground plane: radius and depth below the base as shares of the arm's length
GROUND_RADIUS = 0.7
GROUND_DEPTH = 0.02
CELLS = 10.0  # approximate number of grid cells from the center to the rim
# gravity arrow: tail, see `Mounting.placed`, and length as a share of the arm's length
ARROW_TAIL = np.array([-0.45, -0.38, 0.35])
ARROW_LENGTH = 0.3


@dataclass(frozen=True, eq=False)
class Mounting:
    """Rotation of an arm's base frame in the world.

    In the world, z is up. A lying arm points along the world's x axis. Without gravity
    the arm is drawn standing.

    Attributes:
        turn: rotation from the base frame to the world; its rows are the world's axes
            in the base frame.
        gravity: direction of gravity, base frame, or zero.
        word: "stands", "hangs", "lies", or "floats" without gravity.
    """

    turn: Float[np.ndarray, "3 3"]
    gravity: Point
    word: str

    @classmethod
    def of(cls, arm: ArmSpec) -> "Mounting":
        """Mounting that follows from an arm's direction of gravity."""
        gravity = np.array(arm.gravity_direction, float)
        up = np.array([0.0, 0.0, 1.0])
        if gravity.any():
            up = -gravity / np.linalg.norm(gravity)
        lies = abs(up[2]) < STEEP
        ahead = np.array([0.0, 0.0, 1.0] if lies else [1.0, 0.0, 0.0])
        ahead = ahead - (ahead @ up) * up
        ahead = ahead / np.linalg.norm(ahead)
        if not gravity.any():
            word = "floats"
        elif lies:
            word = "lies"
        else:
            word = "stands" if up[2] > 0 else "hangs"
        return cls(np.stack([ahead, np.cross(up, ahead), up]), gravity, word)

    def placed(self, point) -> Point:
        """Transfer a point near a standing arm of length one to this mounting.

        The height above a standing arm's base becomes a depth below a hanging arm's.
        The middle of a lying arm takes the place of a standing arm's.

        Args:
            point: such as a camera position, world axes.

        Returns:
            The corresponding point in the base frame, for an arm of length one.
        """
        x, y, z = point
        if self.word == "hangs":
            z = -z
        elif self.word == "lies":
            x = x + 0.5
            z = z - 0.5
        return (x, y, z) @ self.turn

    def flat(self, view: View) -> tuple[View, tuple[bool, bool]]:
        """Axes of a two-dimensional drawing, as seen in a view of the world.

        Args:
            view: world axes to the right and upward, such as `SIDE`.

        Returns:
            The base frame's axes nearest to them, and whether each runs backward.
        """
        axes = {0 if self.word == "lies" else 2: 2}  # the arm's axis is in the drawing
        for world in {0, 1, 2} - set(axes):
            unused = {0, 1, 2} - set(axes.values())
            axes[world] = max(unused, key=lambda axis: abs(self.turn[world, axis]))
        right, up = view
        nearest = (axes[right], axes[up])
        signs = self.turn[view, nearest]
        return nearest, (signs[0] < 0, signs[1] < 0)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Ground plane (floor, ceiling or wall) and gravity arrow, base frame [m].

    Attributes:
        mounting: orientation of the arm in the world.
        spacing: of the grid lines; 1, 2 or 5 times a power of ten.
        radius: of the grid.
        level: z of the plane, below the base.
        grid: ends of the grid lines on a circle; lines along y, then along x.
        through_origin: mask of the grid lines that pass through the origin.
        names: positions of the axis names in the plane.
        arrow: tail and tip of the gravity arrow; None if the arm stands or floats.
    """

    mounting: Mounting
    spacing: float
    radius: float
    level: float
    grid: Points
    through_origin: Bool[np.ndarray, " lines"]
    names: dict[str, Point]
    arrow: Points | None

    @classmethod
    def of(cls, arm: ArmSpec) -> "Surroundings":
        """Surroundings scaled to an arm."""
        mounting = Mounting.of(arm)
        size = arm.length
        # smallest 1, 2 or 5 times a power of ten that is at least a value
        value = GROUND_RADIUS * size / CELLS
        candidates = 10.0 ** np.floor(np.log10(value)) * np.array([1, 2, 5, 10])
        spacing = float(candidates[candidates >= 0.999 * value][0])
        cells = int(np.ceil(GROUND_RADIUS * size / spacing))
        radius = spacing * cells
        level = -GROUND_DEPTH * size
        steps = np.arange(1 - cells, cells)
        # ends of chords of a circle: along y at x = offsets, then along x
        offsets = spacing * steps
        rim = np.outer([-1, 1], np.sqrt(radius**2 - offsets**2))
        ends = np.stack(np.broadcast_arrays(offsets, rim, level), axis=-1)
        along_y = ends.swapaxes(0, 1)
        names = {
            "x": np.array([1.06 * radius, 0.0, level]),
            "y": np.array([0.0, 1.06 * radius, level]),
        }
        arrow = None
        if mounting.word not in ("stands", "floats"):
            shift = np.outer([0.0, ARROW_LENGTH], mounting.gravity)
            arrow = size * (mounting.placed(ARROW_TAIL) + shift)
        return cls(
            mounting=mounting,
            spacing=spacing,
            radius=radius,
            level=level,
            grid=np.concatenate([along_y, along_y[..., [1, 0, 2]]]),
            through_origin=np.tile(steps == 0, 2),
            names=names,
            arrow=arrow,
        )
