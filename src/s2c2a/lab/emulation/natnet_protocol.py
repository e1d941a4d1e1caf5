"""Messages of NatNet, the side of Motive, as open clients of the protocol read them.

It shares no code with `s2c2a.lab.tracking.natnet`, so that one tests the other.
"""

import struct
from collections.abc import Sequence

import numpy as np

from s2c2a.lab.emulation.plant import FramePose
from s2c2a.lab.emulation.tracked_bodies import Bodies, StreamedBody

CONNECT = 0
SERVER_INFO = 1
REQUEST = 2
REQUEST_DEFINITIONS = 4
DEFINITIONS = 5
FRAME = 7
KEEP_ALIVE = 10
UNRECOGNIZED = 100

VERSIONS = ("3.1", "4.0", "4.1", "4.2")
"""Versions that are emulated; 4.2 differs from 4.1 in the definitions of bodies."""
TICKS = 10_000_000
"""Rate of Motive's clock [Hz]."""

_APPLICATION = b"Emulated Motive"
_APPLICATION_VERSIONS = {"3.1": (2, 3), "4.0": (3, 0), "4.1": (3, 1), "4.2": (3, 2)}
_MARKERS = np.array(
    [
        [0.03, 0.0, 0.0],
        [-0.02, 0.02, 0.0],
        [-0.01, -0.03, 0.0],
    ]
)
"""Positions of the markers of a body [m], frame of the body."""
_MARKER_SIZE = 0.0095  # m
_MARKER_ERROR = 0.0002  # m
_TRACKED = 1


def numbers(version: str) -> tuple[int, int]:
    """Return the numbers of a version."""
    major, minor = version.split(".")
    return int(major), int(minor)


def pack(kind: int, content: bytes) -> bytes:
    """Return a message."""
    return struct.pack("<HH", kind, len(content)) + content


def unpack(data: bytes) -> tuple[int, bytes]:
    """Return kind and content of a message; kind -1 if it has no header."""
    if len(data) < 4:
        return -1, b""
    (kind,) = struct.unpack_from("<H", data)
    return kind, data[4:]


def encode_server_info(version: str, port: int, group: str) -> bytes:
    """Return the answer to a client that connects.

    Args:
        version: of the stream.
        port: of the frames.
        group: multicast address of the frames; empty: unicast.
    """
    address = bytes(map(int, group.split("."))) if group else bytes(4)
    application = bytes((*_APPLICATION_VERSIONS[version], 0, 0))
    stream = bytes((*numbers(version), 0, 0))
    content = struct.pack("<256s4s4s", _APPLICATION, application, stream)
    content += struct.pack("<QHB4s", TICKS, port, bool(group), address)
    return pack(SERVER_INFO, content)


def _text(text: str) -> bytes:
    return text.encode() + b"\0"


def _count(count: int) -> bytes:
    return struct.pack("<I", count)


def encode_definitions(version: str, names: Sequence[str]) -> bytes:
    """Return the definitions of all bodies: marker sets and rigid bodies.

    Args:
        version: of the stream.
        names: of the bodies, whose ids count from 1.
    """
    definitions = [(0, _marker_set_definition(name)) for name in names]
    definitions += [
        (1, _body_definition(version, number, name))
        for number, name in enumerate(names, start=1)
    ]
    content = _count(len(definitions))
    for kind, definition in definitions:
        content += _count(kind)
        if numbers(version) >= (4, 1):
            content += _count(len(definition))
        content += definition
    return pack(DEFINITIONS, content + _count(0))


def _marker_names(name: str) -> list[str]:
    return [f"{name}_Marker{number}" for number in range(1, len(_MARKERS) + 1)]


def _marker_set_definition(name: str) -> bytes:
    markers = _marker_names(name)
    return _text(name) + _count(len(markers)) + b"".join(map(_text, markers))


def _body_definition(version: str, number: int, name: str) -> bytes:
    content = _text(name) + struct.pack("<ii3f", number, -1, 0.0, 0.0, 0.0)
    if numbers(version) >= (4, 2):
        content += struct.pack("<4f", 0.0, 0.0, 0.0, 1.0)
    content += _count(len(_MARKERS)) + _MARKERS.astype("<f4").tobytes()
    content += struct.pack(f"<{len(_MARKERS)}i", *[0] * len(_MARKERS))
    if numbers(version) >= (4, 0):
        content += b"".join(map(_text, _marker_names(name)))
    return content


def encode_frame(
    version: str,
    number: int,
    time: float,
    bodies: Bodies,
    latency: float = 0.0,
) -> bytes:
    """Return a frame of data.

    Args:
        version: of the stream.
        number: of the frame.
        time: of the exposure, on Motive's clock [s].
        bodies: rigid bodies by name, whose ids count from 1.
        latency: from the exposure to the transmission [s].
    """
    markers = {name: _marker_positions(body.pose) for name, body in bodies.items()}
    sections = [
        (len(bodies), b"".join(_marker_set(*item) for item in markers.items())),
        (0, b""),  # unlabeled markers
        (len(bodies), _rigid_bodies(list(bodies.values()))),
        (0, b""),  # skeletons
        (len(bodies) * len(_MARKERS), _labeled_markers(list(markers.values()))),
        (0, b""),  # force plates
        (0, b""),  # devices
    ]
    has_sizes = numbers(version) >= (4, 1)
    if has_sizes:
        sections.insert(4, (0, b""))  # assets
    content = _count(number)
    for count, section in sections:
        size = _count(len(section)) if has_sizes else b""
        content += _count(count) + size + section
    return pack(FRAME, content + _suffix(version, time, latency))


def _marker_positions(pose: FramePose) -> np.ndarray:
    """Return the positions of a body's markers [m], shape (markers, 3)."""
    vector = pose.rotation[:3]
    turned = np.cross(vector, _MARKERS) + pose.rotation[3] * _MARKERS
    return pose.position + _MARKERS + 2 * np.cross(vector, turned)


def _marker_set(name: str, positions: np.ndarray) -> bytes:
    return _text(name) + _count(len(positions)) + positions.astype("<f4").tobytes()


def _rigid_bodies(bodies: Sequence[StreamedBody]) -> bytes:
    content = b""
    for number, body in enumerate(bodies, start=1):
        pose = body.pose
        flags = _TRACKED if body.is_tracked else 0
        values = (*pose.position, *pose.rotation, _MARKER_ERROR)
        content += struct.pack("<i8fh", number, *values, flags)
    return content


def _labeled_markers(positions: Sequence[np.ndarray]) -> bytes:
    content = b""
    for body, markers in enumerate(positions, start=1):
        for marker, position in enumerate(markers, start=1):
            id = body << 16 | marker
            values = (*position, _MARKER_SIZE)
            content += struct.pack("<i4fhf", id, *values, 10, _MARKER_ERROR)
    return content


def _suffix(version: str, time: float, latency: float) -> bytes:
    ticks = int(time * TICKS)
    sent = ticks + int(latency * TICKS)
    content = struct.pack("<IIdQQQ", 0, 0, time, ticks, sent, sent)
    if numbers(version) >= (4, 1):
        content += struct.pack("<II", int(time), int(time % 1.0 * 2**32))
    return content + struct.pack("<HI", 4, 0)  # live mode, end of the data
