"""Pinhole camera that stays upright in the world, given in the arm's base frame."""

from dataclasses import dataclass

import numpy as np

from s2c2a.viz.arrays import Point, Points
from s2c2a.viz.mesh import unit
from s2c2a.viz.mounting import Mounting


@dataclass(frozen=True, eq=False)
class Camera:
    """Position and orientation of a camera, base frame.

    Attributes:
        eye: position [m].
        forward: viewing direction, unit vector.
        right: direction to the right in the image, unit vector.
        distance: from the eye to the point that the camera looks at [m].
    """

    eye: Point
    forward: Point
    right: Point
    distance: float

    @classmethod
    def of(cls, mounting: Mounting, length: float, eye, look_at) -> "Camera":
        """Camera for a mounted arm.

        Args:
            mounting: orientation of the arm in the world.
            length: of the arm [m].
            eye: position around a standing arm of length one, see `Mounting.placed`.
            look_at: point in the middle of the image, in the same units.
        """
        position = length * mounting.placed(eye)
        offset = length * mounting.placed(look_at) - position
        forward = unit(offset)
        right = unit(np.cross(forward, mounting.turn[2]))
        return cls(position, forward, right, float(np.linalg.norm(offset)))

    def coordinates(self, points: Points) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates of points to the right, upward and forward [m], each (*n)."""
        offsets = points - self.eye
        up = np.cross(self.right, self.forward)
        return offsets @ self.right, offsets @ up, offsets @ self.forward
