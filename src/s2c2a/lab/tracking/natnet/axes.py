"""Axes of a stream: Motive has y or z up, and this package z."""

from s2c2a.lab.tracking.axes import UP_AXES, turn_up
from s2c2a.lab.tracking.natnet.messages import Body
from s2c2a.lab.tracking.poses import Pose, TrackingError


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
    """Return `T_world_body` with the z axis up; see `turn_up`.

    Args:
        body: in the axes of the stream.
        up: vertical axis of the stream.

    Raises:
        PoseError: the pose is implausible.
    """
    return turn_up(body.position, body.rotation, up)
