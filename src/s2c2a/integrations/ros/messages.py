"""Standard ROS 2 messages as bytes (CDR), and their types.

Definitions come with the package `rosbags`; nothing is downloaded. The fields of all
types used here are the same from ROS 2 Iron to Lyrical.
"""

from functools import cache
from typing import Any

from s2c2a.errors import S2C2AError
from s2c2a.integrations.extras import needs_extra

POINT = "geometry_msgs/msg/PointStamped"
POSE = "geometry_msgs/msg/PoseStamped"
JOINTS = "sensor_msgs/msg/JointState"
MARKERS = "visualization_msgs/msg/MarkerArray"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
TEXT = "std_msgs/msg/String"
SWITCH = "std_msgs/msg/Bool"

MAX_MESSAGE = 65_536  # bytes; 16 obstacles have 4 kB, and a batch of Zenoh this size
NANOSECONDS = 1_000_000_000  # in a second


class MessageError(S2C2AError):
    """A message that the arm does not obey."""


@cache
def type_store() -> Any:
    """The definitions of the standard messages.

    Raises:
        S2C2AError: the extra is missing.
    """
    with needs_extra("ros", "ROS 2"):
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415  # an extra
    return get_typestore(Stores.ROS2_JAZZY)


def new(type_name: str, **fields: Any) -> Any:
    """A message of a type, such as "std_msgs/msg/Bool", from all of its fields."""
    return type_store().types[type_name](**fields)


def type_hash(type_name: str) -> str:
    """Hash of a type's definition (REP 2016), such as RIHS01_df66...."""
    return type_store().hash_rihs01(type_name)


def encode(type_name: str, message: Any) -> bytes:
    """The message as CDR with its header of four bytes, little-endian."""
    return bytes(type_store().serialize_cdr(message, type_name))


def decode(type_name: str, payload: bytes) -> Any:
    """The message of these bytes.

    Raises:
        MessageError: they are too many, or no such message.
    """
    if len(payload) > MAX_MESSAGE:
        raise MessageError(
            f"it has {len(payload)} bytes; at most {MAX_MESSAGE} are read"
        )
    try:
        return type_store().deserialize_cdr(payload, type_name)
    except Exception as error:  # whatever bytes of strangers lead to
        raise MessageError(f"it is no {type_name} ({error!r})") from error


def header_of(frame: str, moment: float) -> Any:
    """Header of a message in a frame, stamped with a time since 1970 [s]."""
    seconds, nanoseconds = divmod(round(moment * NANOSECONDS), NANOSECONDS)
    stamp = new("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return new("std_msgs/msg/Header", stamp=stamp, frame_id=frame)
