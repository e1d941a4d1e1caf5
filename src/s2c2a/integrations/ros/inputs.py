"""Messages of ROS 2 as changes of the live request; what does not fit is refused."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from s2c2a.errors import no_such
from s2c2a.integrations.ros.messages import NANOSECONDS, MessageError
from s2c2a.live.request import MAX_OBSTACLES, Obstacle, Point, RequestLimits, point
from s2c2a.obstacles import turned

# s; of a stamp, chosen: a target of before a lost connection is no target, and a clock
# that is ahead would hide its age
MAX_AGE = 1.0
UNIT_TOLERANCE = 0.01  # of a quaternion's length: rounding, and no other mistake
SPHERE = 2  # visualization_msgs/Marker.SPHERE
ADD = 0  # visualization_msgs/Marker.ADD
DELETE_ALL = 3  # visualization_msgs/Marker.DELETEALL
NO_TASK: dict[str, Any] = {"task": None, "playing": False}

Changes = dict[str, Any]


@dataclass(frozen=True)
class Inputs:
    """Reads messages for one arm.

    Attributes:
        limits: of the requests.
        frame: id of the base frame.
        now: time since 1970 [s].
    """

    limits: RequestLimits
    frame: str
    now: Callable[[], float]

    def point(self, message: Any) -> Changes:
        """Target of a PointStamped [m]; any end axis."""
        self._check_header(message.header)
        target = self._within_reach(message.point)
        return {"target": target, "axis": None, "shape": None, **NO_TASK}

    def pose(self, message: Any) -> Changes:
        """Target of a PoseStamped [m]; its z axis is the end axis."""
        self._check_header(message.header)
        target = self._within_reach(message.pose.position)
        axis = _z_axis(message.pose.orientation)
        return {"target": target, "axis": axis, "shape": None, **NO_TASK}

    def obstacles(self, message: Any) -> Changes:
        """All obstacles: the spheres of a MarkerArray.

        Those beyond reach are left out, as the limits would move them nearer.
        """
        markers = [each for each in message.markers if each.action != DELETE_ALL]
        if len(markers) > MAX_OBSTACLES:
            raise MessageError(
                f"it has {len(markers)} obstacles; at most {MAX_OBSTACLES} are allowed"
            )
        spheres = [self._sphere(marker) for marker in markers]
        near = [each for each in spheres if _length(each.center) <= self.limits.reach]
        return {"obstacles": tuple(near)}

    def task(self, message: Any) -> Changes:
        """Task of a String, which plays; an empty one ends the task."""
        name = message.data
        if not name:
            return NO_TASK
        if name not in self.limits.tasks:
            raise MessageError(no_such("task", name[:40], self.limits.tasks))
        return {"task": name, "playing": True}

    def _check_header(self, header: Any) -> None:
        if header.frame_id != self.frame:
            raise MessageError(
                f"its frame is '{header.frame_id[:40]}'; transform it to '{self.frame}'"
            )
        stamp = header.stamp.sec + header.stamp.nanosec / NANOSECONDS
        age = self.now() - stamp
        if stamp and abs(age) > MAX_AGE:  # `ros2 topic pub` sends zero
            raise MessageError(
                f"its stamp is {age:.1f} s old, and at most {MAX_AGE:g} s are allowed; "
                "synchronize the clocks, or leave the stamp zero"
            )

    def _within_reach(self, value: Any) -> Point:
        target = _point(value)
        if _length(target) > self.limits.reach:
            raise MessageError(
                f"the target is {_length(target):g} m from the base, and at most "
                f"{self.limits.reach:g} m are allowed; the unit is the meter"
            )
        return target

    def _sphere(self, marker: Any) -> Obstacle:
        self._check_header(marker.header)
        if (marker.type, marker.action) != (SPHERE, ADD):
            raise MessageError(
                f"marker {marker.id} has type {marker.type} and action {marker.action}; "
                "send all obstacles in one message, each as SPHERE (2) with ADD (0)"
            )
        x, y, z = _point(marker.scale)
        if not 0.0 < x == y == z <= self.limits.reach / 2:
            raise MessageError(
                f"marker {marker.id} has the scale {x:g} {y:g} {z:g}; give three equal "
                f"diameters of at most {self.limits.reach / 2:g} m"
            )
        return Obstacle(_point(marker.pose.position), x / 2)


def _point(value: Any) -> Point:
    numbers = point((value.x, value.y, value.z))
    if not all(map(math.isfinite, numbers)):
        raise MessageError(f"its numbers {numbers} are not all finite")
    return numbers


def _length(value: Point) -> float:
    return math.hypot(*value)


def _z_axis(quaternion: Any) -> Point:
    turn = np.array([*_point(quaternion), quaternion.w])
    if not abs(np.linalg.norm(turn) - 1.0) <= UNIT_TOLERANCE:  # also NaN
        raise MessageError(
            f"its orientation {turn.tolist()} is no unit quaternion; send "
            "0 0 0 1 for the z axis, or a PointStamped for any direction"
        )
    return point(turned(np.array([0.0, 0.0, 1.0]), turn[:3], turn[3:]))
