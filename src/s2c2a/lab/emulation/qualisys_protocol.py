"""Packets of the QTM RT protocol, the side of QTM, from its public documentation.

It shares no code with `s2c2a.lab.tracking.qualisys`, so that one tests the other.
"""

import struct
from collections.abc import Iterable, Sequence
from xml.sax.saxutils import escape

import numpy as np

from s2c2a.lab.emulation.plant import FramePose
from s2c2a.lab.emulation.tracked_bodies import StreamedBody

ERROR = 0
COMMAND = 1
XML = 2
DATA = 3
NO_MORE_DATA = 4

VERSIONS = ("1.8", "1.20", "1.25")
"""Newest versions of emulated programs; each one serves the older ones, too."""
SIX_DOF = 5
_MILLIMETERS = 1000.0  # of a meter
_MICROSECONDS = 1_000_000  # of a second
_LOST = struct.pack("<12f", *[float("nan")] * 12)


def pack(kind: int, content: bytes = b"") -> bytes:
    """Return a packet."""
    return struct.pack("<II", 8 + len(content), kind) + content


def pack_text(kind: int, text: str) -> bytes:
    """Return a packet whose content is a text with a final zero."""
    return pack(kind, text.encode() + b"\0")


def take_commands(buffer: bytearray) -> list[str]:
    """Remove the complete packets from a buffer, and return their texts.

    A packet that cannot be one of a client empties the buffer.
    """
    commands = []
    while len(buffer) >= 8:
        (size, kind) = struct.unpack_from("<II", buffer)
        if not 8 <= size <= 4096:
            buffer.clear()
            break
        if len(buffer) < size:
            break
        text = bytes(buffer[8:size]).rstrip(b"\0").decode(errors="replace")
        del buffer[:size]
        commands.append(text if kind == COMMAND else "")
    return commands


def encode_parameters(version: str, names: Sequence[str], up: str) -> bytes:
    """Return the parameters 3D and 6D.

    Args:
        version: of the connection.
        names: of the bodies, in the order of the frames.
        up: vertical axis, "y" or "z".
    """
    root = f"QTM_Parameters_Ver_{version}"
    bodies = "".join(map(_body_parameters, names))
    text = (
        f"<{root}><The_3D><AxisUpwards>+{up.upper()}</AxisUpwards>"
        "<CalibrationTime></CalibrationTime><Labels>0</Labels></The_3D>"
        f"<The_6D><Bodies>{len(names)}</Bodies>{bodies}"
        "<Euler><First>Roll</First><Second>Pitch</Second><Third>Yaw</Third></Euler>"
        f"</The_6D></{root}>"
    )
    return pack_text(XML, text)


def _body_parameters(name: str) -> str:
    return (
        f"<Body><Name>{escape(name)}</Name><RGBColor>255</RGBColor>"
        "<Point><X>30.0</X><Y>0.0</Y><Z>0.0</Z></Point></Body>"
    )


def encode_frame(number: int, time: float, bodies: Iterable[StreamedBody]) -> bytes:
    """Return a data packet with the component 6D.

    Args:
        number: of the frame.
        time: of the exposure, on QTM's clock [s].
        bodies: in the order of the parameters.
    """
    contents = [_encode_body(body) for body in bodies]
    section = struct.pack("<IHH", len(contents), 0, 0) + b"".join(contents)
    component = struct.pack("<II", 8 + len(section), SIX_DOF) + section
    header = struct.pack("<qII", round(time * _MICROSECONDS), number, 1)
    return pack(DATA, header + component)


def _encode_body(body: StreamedBody) -> bytes:
    if not body.is_tracked:
        return _LOST
    position = _MILLIMETERS * body.pose.position
    # column by column
    matrix = _rotation_matrix(body.pose).T.ravel()
    values = np.concatenate([position, matrix])
    return values.astype("<f4").tobytes()


def _rotation_matrix(pose: FramePose) -> np.ndarray:
    """Return the matrix whose columns are the axes of the body, shape (3, 3)."""
    vector = pose.rotation[:3]
    scalar = pose.rotation[3]
    cross = np.cross(np.eye(3), vector)
    return np.eye(3) + 2 * scalar * cross + 2 * cross @ cross
