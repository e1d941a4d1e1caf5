"""NatNet messages: requests to Motive, and parsing of what it sends.

Pure functions and values, without sockets; `layouts` has the versions as data.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from struct import Struct

from s2c2a.lab.tracking.datagrams import DatagramError, DropReason
from s2c2a.lab.tracking.natnet.layouts import (
    BODY_SIZE,
    COUNT_SIZE,
    ELEMENTS,
    FLAGS_AT,
    RIGID_BODY,
    SUFFIX_TIME,
    TEXT,
    MessageLayout,
    Part,
    Repeated,
    Section,
    Version,
    minimum_size,
)

MAX_MESSAGE = 65_507
"""Largest datagram over IPv4 [bytes]."""
MAX_COUNT = 10_000
"""Most elements of a section; Motive streams less."""
MAX_NAME = 256  # bytes
PREFERRED_VERSION = Version(4, 1)
"""For which a client asks when it connects; Motive may stream another."""

_HEADER = Struct("<HH")
_COUNT = Struct("<I")
_DOUBLE = Struct("<d")
_FLAGS = Struct("<H")
_BODY = Struct("<i3f4ffH")
_ID = Struct("<i")
_SERVER_INFO = Struct("<256s4s4s")
_CONNECTION = Struct("<QHB4s")
_CONNECT = Struct("<4s260xx4s2x")
_TRACKED = 0x01
_MODELS_CHANGED = 0x02


class MessageKind(IntEnum):
    """Kinds of messages that a client needs."""

    CONNECT = 0
    SERVER_INFO = 1
    REQUEST_DEFINITIONS = 4
    DEFINITIONS = 5
    FRAME = 7
    KEEP_ALIVE = 10


class Reader:
    """Reads values of a message, and never beyond its end."""

    def __init__(self, content: bytes | memoryview):
        """Begin at the first byte."""
        self._content = memoryview(content)
        self._offset = 0

    @property
    def remaining(self) -> int:
        """Number of bytes that are left."""
        return len(self._content) - self._offset

    def take(self, size: int) -> memoryview:
        """Return the next bytes.

        Raises:
            DatagramError: fewer are left.
        """
        if size > self.remaining:
            raise malformed(f"{size} bytes expected, {self.remaining} are left")
        start = self._offset
        self._offset += size
        return self._content[start : self._offset]

    def peek(self) -> memoryview:
        """Return the bytes that are left."""
        return self._content[self._offset :]

    def section(self, size: int) -> "Reader":
        """Return a reader of the next bytes."""
        return Reader(self.take(size))

    def unpack(self, form: Struct) -> tuple:
        """Return the next values."""
        return form.unpack(self.take(form.size))

    def count(self, size: int) -> int:
        """Return a count of elements, each of which takes at least `size` bytes.

        Raises:
            DatagramError: so many do not fit.
        """
        (count,) = self.unpack(_COUNT)
        if count > MAX_COUNT or count * size > self.remaining:
            raise malformed(f"a count of {count} does not fit into the message")
        return count

    def text(self) -> bytes:
        """Return the bytes before the next zero byte, and go behind it.

        Raises:
            DatagramError: no zero byte follows.
        """
        content = bytes(self._content[self._offset : self._offset + MAX_NAME + 1])
        text, end, _ = content.partition(b"\0")
        if not end:
            raise malformed(f"a text does not end within {MAX_NAME} bytes")
        self._offset += len(text) + 1
        return text


def malformed(message: str) -> DatagramError:
    """Return the error of a message that does not follow its layout."""
    return DatagramError(message, DropReason.MALFORMED)


def encode_request(kind: MessageKind) -> bytes:
    """Return a request to Motive: `CONNECT`, `REQUEST_DEFINITIONS` or `KEEP_ALIVE`."""
    content = b"\0"
    if kind is MessageKind.CONNECT:
        content = _CONNECT.pack(b"Ping", bytes((*PREFERRED_VERSION, 0, 0)))
    return _HEADER.pack(kind, len(content)) + content


def split_message(content: bytes) -> tuple[int, Reader]:
    """Return the kind of a message and a reader of what follows its header.

    Raises:
        DatagramError: it is shorter than its header says, or longer than allowed.
    """
    if len(content) > MAX_MESSAGE:
        raise DatagramError(f"more than {MAX_MESSAGE} bytes", DropReason.OVERSIZED)
    reader = Reader(content)
    kind, size = reader.unpack(_HEADER)
    return kind, reader.section(size)


@dataclass(frozen=True)
class ServerInfo:
    """What Motive tells of itself.

    Attributes:
        version: of the stream.
        group: multicast address and port of the frames; None: unicast, or unknown.
    """

    version: Version
    group: tuple[str, int] | None


def parse_server_info(reader: Reader) -> ServerInfo:
    """Parse the answer to a request to connect.

    Raises:
        DatagramError: it is too short.
    """
    _, _, numbers = reader.unpack(_SERVER_INFO)
    version = Version(numbers[0], numbers[1])
    if reader.remaining < _CONNECTION.size:
        return ServerInfo(version, None)
    _, port, is_multicast, address = reader.unpack(_CONNECTION)
    group = (".".join(map(str, address)), port) if is_multicast else None
    return ServerInfo(version, group)


def parse_definitions(reader: Reader, layout: MessageLayout) -> dict[int, str]:
    """Return the names of rigid bodies by id.

    Raises:
        DatagramError: the message does not follow the layout, or an id has two names.
    """
    names: dict[int, str] = {}
    for kind, definition in _definitions(reader, layout):
        if kind == RIGID_BODY:
            name = _decode(definition.text())
            (id,) = definition.unpack(_ID)
            if names.setdefault(id, name) != name:
                raise malformed(f"rigid body {id} has two names")
    return names


def _definitions(reader: Reader, layout: MessageLayout) -> Iterator[tuple[int, Reader]]:
    """Yield types of definitions, each with a reader of its content."""
    for _ in range(reader.count(COUNT_SIZE)):
        (kind,) = reader.unpack(_COUNT)
        if layout.has_sizes:
            (size,) = reader.unpack(_COUNT)
        else:
            # versions without sizes: measure the definition that follows [bytes]
            if kind not in layout.definitions:
                raise malformed(f"there is no definition of type {kind}")
            ahead = Reader(reader.peek())
            _skip(ahead, layout.definitions[kind])
            size = reader.remaining - ahead.remaining
        yield kind, reader.section(size)


def _decode(text: bytes) -> str:
    try:
        return text.decode()
    except UnicodeDecodeError as error:
        raise malformed(f"a name is not UTF-8: {error}") from error


@dataclass(frozen=True)
class RigidBody:
    """A rigid body that is tracked.

    Attributes:
        id: of the definition.
        position: in the axes of the stream [m].
        rotation: unit quaternion (x, y, z, w), in the axes of the stream.
    """

    id: int
    position: tuple[float, float, float]
    rotation: tuple[float, float, float, float]


@dataclass(frozen=True)
class NatNetFrame:
    """A frame of data.

    Attributes:
        number: of the frame.
        time: on the clock of Motive [s].
        bodies: rigid bodies that are tracked; a lost one is absent.
        models_changed: whether the definitions are to be requested again.
    """

    number: int
    time: float
    bodies: tuple[RigidBody, ...]
    models_changed: bool


def parse_frame(reader: Reader, layout: MessageLayout) -> NatNetFrame:
    """Parse a frame of data.

    Raises:
        DatagramError: the message does not follow the layout, a body occurs twice, or
            the time is not finite.
    """
    (number,) = reader.unpack(_COUNT)
    bodies: tuple[RigidBody, ...] = ()
    for section in layout.sections:
        if section is Section.RIGID_BODIES:
            count = reader.count(BODY_SIZE)
            size = count * BODY_SIZE
            if layout.has_sizes and reader.unpack(_COUNT) != (size,):
                raise malformed(f"{count} rigid bodies do not take {size} bytes")
            values = list(_BODY.iter_unpack(reader.take(size)))
            if len({id for id, *_ in values}) < count:
                raise malformed("a rigid body occurs twice")
            tracked = [body for body in values if body[-1] & _TRACKED]
            bodies = tuple(
                RigidBody(body[0], position=body[1:4], rotation=body[4:8])
                for body in tracked
            )
        else:
            _skip_section(reader, section, layout)
    time, flags = _read_suffix(reader, layout)
    return NatNetFrame(number, time, bodies, bool(flags & _MODELS_CHANGED))


def _skip_section(reader: Reader, section: Section, layout: MessageLayout) -> None:
    element = ELEMENTS[section]
    if layout.has_sizes:
        reader.count(minimum_size(element))
        (size,) = reader.unpack(_COUNT)
        reader.take(size)
    else:
        _skip_repeated(reader, Repeated(element))


def _skip(reader: Reader, part: Part) -> None:
    """Go behind a part."""
    if isinstance(part, int):
        reader.take(part)
    elif isinstance(part, tuple):
        for one in part:
            _skip(reader, one)
    elif isinstance(part, Repeated):
        _skip_repeated(reader, part)
    elif part is TEXT:
        reader.text()


def _skip_repeated(reader: Reader, repeated: Repeated) -> None:
    count = reader.count(minimum_size(repeated.parts))
    for part in repeated.parts:
        if isinstance(part, int):
            reader.take(count * part)
        else:
            for _ in range(count):
                _skip(reader, part)


def _read_suffix(reader: Reader, layout: MessageLayout) -> tuple[float, int]:
    """Return time [s] and flags from the end of a frame."""
    size = reader.remaining
    if size not in layout.suffixes:
        raise malformed(f"the frame ends with {size} bytes, not {layout.suffixes}")
    suffix = reader.take(size)
    (time,) = _DOUBLE.unpack_from(suffix, SUFFIX_TIME)
    (flags,) = _FLAGS.unpack_from(suffix, FLAGS_AT[size])
    if not math.isfinite(time):
        raise DatagramError(f"the time is {time}", DropReason.IMPLAUSIBLE)
    return time, flags
