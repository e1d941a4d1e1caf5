"""Axes of a stream: sources have y or z up, and this package z."""

from collections.abc import Sequence

import numpy as np

from s2c2a.lab.tracking.poses import Pose

UP_AXES = ("y", "z")


def turn_up(position: Sequence[float], rotation: Sequence[float], up: str) -> Pose:
    """Return `T_world_body` with the z axis up.

    Coordinates (x, y, z) with y up become (x, -z, y). The vector of the quaternion
    turns alike, so that a body with the axes of the world keeps them.

    Args:
        position: of the body [m], in the axes of the stream.
        rotation: unit quaternion (x, y, z, w), in the axes of the stream.
        up: vertical axis of the stream.

    Raises:
        PoseError: the pose is implausible.
    """
    if up == "z":
        return Pose.measured(position, rotation)
    *vector, scalar = rotation
    turned = np.array([*_turn(*vector), scalar])
    return Pose.measured(_turn(*position), turned)


def _turn(x: float, y: float, z: float) -> tuple[float, float, float]:
    return x, -z, y
