"""Axes of a stream: Motive has y or z up, and this package z."""

import numpy as np

from s2c2a.tracking.natnet.messages import Body
from s2c2a.tracking.poses import Pose, TrackingError

UP_AXES = ("y", "z")


def check_up_axis(up: str) -> None:
    """Check the name of an up axis.

    Raises:
        TrackingError: there is no such axis.
    """
    if up not in UP_AXES:
        raise TrackingError(
            f"up axis '{up}'; give y or z, as in Motive's streaming settings"
        )


def z_up_pose(body: Body, up: str) -> Pose:
    """Return `T_world_body` with the z axis up.

    Coordinates (x, y, z) with y up become (x, -z, y). The vector of the quaternion
    turns alike, so that a body with the axes of the world keeps them.

    Args:
        body: in the axes of the stream.
        up: vertical axis of the stream.

    Raises:
        PoseError: the pose is implausible.
    """
    if up == "z":
        return Pose.measured(body.position, body.rotation)
    *vector, scalar = body.rotation
    rotation = np.array([*_turn(*vector), scalar])
    return Pose.measured(_turn(*body.position), rotation)


def _turn(x: float, y: float, z: float) -> tuple[float, float, float]:
    return x, -z, y
