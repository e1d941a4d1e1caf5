"""Packets of the QTM RT protocol: commands to QTM, and parsing of what it sends.

Pure functions and values, without sockets. Source: Qualisys, QTM Real-time Server
Protocol Documentation, version 1.20. Integers and floats are little-endian.
"""

import math
from collections import Counter
from dataclasses import dataclass
from enum import IntEnum
from struct import Struct
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from s2c2a.lab.tracking.datagrams import DatagramError, DropReason
from s2c2a.lab.tracking.poses import Pose, PoseError, turn_up

MAX_PACKET = 1 << 20
"""Largest packet [bytes]; a frame of 100 bodies takes 5 kB."""
MAX_BODIES = 1000
HEADER = Struct("<II")
_FRAME = Struct("<qII")  # time [us], number, components
_BODIES = Struct("<IHH")  # bodies, two rates of lost data
_BODY = Struct("<12f")  # position [mm], rotation matrix column by column
_SIX_DOF = 5
_MICROSECOND = 1e-6
_MILLIMETER = 1e-3
_MAX_MATRIX_ERROR = 1e-3  # of the products of its columns; floats have 1e-7
_UP_AXES = {"+y": "y", "+z": "z"}


class PacketKind(IntEnum):
    """Kinds of packets."""

    ERROR = 0
    COMMAND = 1
    XML = 2
    DATA = 3
    NO_MORE_DATA = 4
    C3D_FILE = 5
    EVENT = 6
    DISCOVER = 7
    QTM_FILE = 8


class QtmPacket(NamedTuple):
    """One packet.

    Attributes:
        kind: of the content.
        content: without the header.
    """

    kind: PacketKind
    content: bytes


class PacketStream:
    """Finds packets in the bytes of a connection."""

    def __init__(self):
        """Begin without bytes."""
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[QtmPacket]:
        """Return the packets that bytes complete.

        Args:
            data: bytes as they come.

        Raises:
            DatagramError: the bytes are no packets; the connection is lost.
        """
        self._buffer += data
        packets = []
        while len(self._buffer) >= HEADER.size:
            size, kind = HEADER.unpack_from(self._buffer)
            is_size = HEADER.size <= size <= MAX_PACKET
            if not is_size or kind > max(PacketKind):
                raise _malformed(f"a packet of kind {kind} and {size} bytes")
            if len(self._buffer) < size:
                break
            content = bytes(self._buffer[HEADER.size : size])
            del self._buffer[:size]
            packets.append(QtmPacket(PacketKind(kind), content))
        return packets


def _malformed(fault: str) -> DatagramError:
    return DatagramError(
        f"{fault} is not of the QTM RT protocol; connect to the little-endian port",
        DropReason.MALFORMED,
    )


def encode_command(command: str) -> bytes:
    """Return the packet of a command."""
    content = command.encode() + b"\0"
    return HEADER.pack(HEADER.size + len(content), PacketKind.COMMAND) + content


def parse_text(content: bytes) -> str:
    """Return the text of a command, an error or parameters."""
    return content.split(b"\0")[0].decode(errors="replace")


@dataclass(frozen=True)
class StreamParameters:
    """Parameters of the stream.

    Attributes:
        names: of the 6DOF bodies, in the order of the frames; empty for a body whose
            name occurs twice.
        up: vertical axis, such as "+z".
    """

    names: tuple[str, ...]
    up: str


def parse_parameters(content: bytes) -> StreamParameters:
    """Parse the answer to `GetParameters 3D 6D`.

    Raises:
        DatagramError: it is no XML of this form.
    """
    text = parse_text(content)
    # entities can expand to gigabytes, and QTM sends none
    if "<!DOCTYPE" in text:
        raise _malformed("XML with declarations")
    try:
        root = ElementTree.fromstring(text)
    # ValueError: an unknown encoding
    except (ElementTree.ParseError, ValueError) as error:
        raise _malformed(f"XML ({error})") from error
    bodies = root.findall("The_6D/Body")
    if not root.tag.startswith("QTM_Parameters") or len(bodies) > MAX_BODIES:
        raise _malformed(f"XML <{root.tag:.40}> with {len(bodies)} bodies")
    names = [(body.findtext("Name") or "").strip() for body in bodies]
    counts = Counter(names)
    unique = tuple(name if counts[name] == 1 else "" for name in names)
    up = (root.findtext("The_3D/AxisUpwards") or "+Z").strip().lower()
    return StreamParameters(unique, up)


@dataclass(frozen=True, eq=False)
class QtmFrame:
    """A frame of 6DOF bodies.

    Attributes:
        time: on QTM's clock [s].
        number: of the frame.
        bodies: position [mm] and rotation matrix column by column, in the axes of the
            stream; None for a body that is lost.
    """

    time: float
    number: int
    bodies: tuple[tuple[float, ...] | None, ...]


def parse_frame(content: bytes) -> QtmFrame:
    """Parse a data packet with one component 6D.

    Raises:
        DatagramError: it is of another form.
    """
    time, number, components = _unpack(_FRAME, content, 0)
    offset = _FRAME.size
    bodies = None
    for _ in range(components):
        size, kind = _unpack(HEADER, content, offset)
        if not HEADER.size <= size <= len(content) - offset:
            raise _malformed(f"a component of {size} bytes")
        if kind == _SIX_DOF:
            section = content[offset + HEADER.size : offset + size]
            count, _, _ = _unpack(_BODIES, section, 0)
            section = section[_BODIES.size :]
            if len(section) != count * _BODY.size:
                raise _malformed(f"{count} bodies in {len(section)} bytes")
            bodies = tuple(
                None if all(map(math.isnan, values[:3])) else values
                for values in _BODY.iter_unpack(section)
            )
        offset += size
    if bodies is None or offset != len(content):
        raise _malformed("a frame without 6D, or with bytes too many,")
    return QtmFrame(_MICROSECOND * time, number, bodies)


def _unpack(layout: Struct, content: bytes, offset: int) -> tuple:
    if len(content) < offset + layout.size:
        raise _malformed("a truncated frame")
    return layout.unpack_from(content, offset)


def body_pose(values: tuple[float, ...], up: str) -> Pose:
    """Return `T_world_body` with the z axis up.

    Args:
        values: position [mm] and rotation matrix column by column.
        up: vertical axis of the stream, "+y" or "+z".

    Raises:
        PoseError: the pose is implausible.
    """
    position = [_MILLIMETER * value for value in values[:3]]
    matrix = np.array(values[3:]).reshape(3, 3).T
    return turn_up(position, quaternion(matrix), _UP_AXES[up])


def is_supported_axis(up: str) -> bool:
    """Whether poses with this vertical axis can be turned."""
    return up in _UP_AXES


def quaternion(matrix: np.ndarray) -> list[float]:
    """Return the unit quaternion (x, y, z, w) of a rotation matrix.

    Args:
        matrix: shape (3, 3).

    Raises:
        PoseError: it is no rotation matrix.
    """
    _check_rotation(matrix)
    return Rotation.from_matrix(matrix).as_quat().tolist()


def _check_rotation(matrix: np.ndarray) -> None:
    # a product of numbers that are not finite, or huge, would warn
    is_bounded = np.isfinite(matrix).all() and np.abs(matrix).max() < 2
    if is_bounded:
        error = np.abs(matrix.T @ matrix - np.eye(3)).max()
        if error <= _MAX_MATRIX_ERROR and np.linalg.det(matrix) > 0:
            return
    raise PoseError(
        f"{matrix.tolist()!r:.200} is no rotation matrix; stream 6D, not 6DEuler"
    )
