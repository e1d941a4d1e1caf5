"""Poses: a position and a rotation, also used as a rigid transform between frames."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from jaxtyping import Float
from pydantic import AfterValidator, BaseModel, ConfigDict

from s2c2a.errors import S2C2AError

MAX_COORDINATE = 100.0  # [m]; larger values are mistakes of units
MAX_LENGTH_ERROR = 0.01  # of a unit quaternion
UP_AXES = ("y", "z")  # of streams; in this package, z is up
CONJUGATE = np.array([-1.0, -1.0, -1.0, 1.0])


class TrackingError(S2C2AError):
    """A tracker cannot start, or its poses cannot be used."""


class PoseError(TrackingError):
    """A pose is not finite, too far away, or has no unit quaternion."""


@dataclass(frozen=True, eq=False)
class Pose:
    """Pose `T_a_b` of frame b in frame a, which maps coordinates of b to those of a.

    Attributes:
        position: of the origin of b [m], frame a, shape (3,).
        rotation: unit quaternion (x, y, z, w) that turns the axes of a into those of
            b, shape (4,); normalized when it is within 1 % of unit length.

    Raises:
        PoseError: wrong shapes, numbers that are not finite, or a quaternion that is
            not of unit length.
    """

    position: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "4"]

    def __post_init__(self):
        position = _finite(self.position, "position", 3)
        rotation = _finite(self.rotation, "rotation", 4)
        # unlike a norm of NumPy, it does not warn of huge numbers
        length = math.hypot(*rotation)
        if abs(length - 1) > MAX_LENGTH_ERROR:
            raise PoseError(
                f"the quaternion {rotation.tolist()} has length {length:g}; "
                "send unit quaternions in the order x, y, z, w"
            )
        object.__setattr__(self, "position", _read_only(position))
        object.__setattr__(self, "rotation", _read_only(rotation / length))

    @classmethod
    def measured(cls, position, rotation) -> Self:
        """Return a pose that a tracker measured, after a check of its range.

        Args:
            position: of the origin of b [m], frame a, three numbers.
            rotation: unit quaternion (x, y, z, w), four numbers.

        Raises:
            PoseError: the pose is invalid, or a coordinate exceeds 100 m.
        """
        pose = cls(position, rotation)
        if np.abs(pose.position).max() > MAX_COORDINATE:
            raise PoseError(
                f"the position {pose.position.tolist()} has a coordinate of more than "
                f"{MAX_COORDINATE:g} m; send meters, or state the units"
            )
        return pose

    @classmethod
    def identity(cls) -> Self:
        """Return the pose of a frame in itself."""
        return cls(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))

    @property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """Rotation matrix, whose columns are the axes of b, frame a, shape (3, 3)."""
        (x, y, z, w) = self.rotation.tolist()
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )

    @property
    def z_axis(self) -> Float[np.ndarray, "3"]:
        """Unit vector of the z axis of b, frame a, shape (3,)."""
        return self.matrix[:, 2]

    def inverse(self) -> "Pose":
        """Return `T_b_a`."""
        conjugate = self.rotation * CONJUGATE
        return Pose(-self.matrix.T @ self.position, conjugate)

    def __matmul__(self, other: "Pose") -> "Pose":
        """Return `T_a_c = T_a_b @ T_b_c`."""
        position = self.position + self.matrix @ other.position
        return Pose(position, _product(self.rotation, other.rotation))


def stored_rotation(rotation: tuple[float, ...]) -> tuple[float, ...]:
    """Return the rotation of a file if it is a unit quaternion, or raise `ValueError`."""
    try:
        Pose(np.zeros(3), np.array(rotation))
    except PoseError as error:
        raise ValueError(str(error)) from error
    return rotation


class StoredTable(BaseModel):
    """What a file keeps, validated when built."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


StoredRotation = Annotated[
    tuple[float, float, float, float], AfterValidator(stored_rotation)
]


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


def angle_between(first: Pose, second: Pose) -> float:
    """Return the angle of the rotation between two poses [rad]."""
    cosine = min(1.0, abs(float(first.rotation @ second.rotation)))
    return 2 * float(np.arccos(cosine))


def are_near(first: Pose, second: Pose, distance: float, turn: float) -> bool:
    """Return whether two poses differ by less than a distance [m] and a turn [rad]."""
    apart = float(np.linalg.norm(first.position - second.position))
    return apart < distance and angle_between(first, second) < turn


def _product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Quaternion of the second rotation followed by the first."""
    (x, y, z, w) = first.tolist()
    # SciPy's rotations take ten times as long for a single pair
    matrix = np.array(
        [[w, -z, y, x], [z, w, -x, y], [-y, x, w, z], [-x, -y, -z, w]],
    )
    return matrix @ second


def _finite(values, name: str, count: int) -> np.ndarray:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise PoseError(f"a {name} is {count} numbers; send numbers only") from error
    if array.shape != (count,) or not np.isfinite(array).all():
        raise PoseError(
            f"a {name} is {count} finite numbers, got {array.tolist()!r:.200}; "
            "omit a body that is lost"
        )
    return array


def _read_only(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array
