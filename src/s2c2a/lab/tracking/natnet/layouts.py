"""Layouts of NatNet messages by version, as data; `messages` walks them.

A layout is a tuple of parts. They follow open clients of the protocol, since its
owner publishes no specification. All values are little-endian.
"""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, TypeAlias, Union


class Version(NamedTuple):
    """Version of the protocol."""

    major: int
    minor: int

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}"


class ZeroEndedText(Enum):
    """UTF-8 text that a zero byte ends."""

    TERMINATED = "terminated"


@dataclass(frozen=True)
class Repeated:
    """A count (4 bytes), then each part that many times, one part after the other.

    Attributes:
        parts: `Repeated(12, 4)` is a count n, n times 12 bytes and n times 4 bytes.
    """

    parts: tuple["Part", ...]

    def __init__(self, *parts: "Part"):
        object.__setattr__(self, "parts", parts)


Part: TypeAlias = Union[int, ZeroEndedText, Repeated, "tuple[Part, ...]"]
"""Number of bytes, text, a repetition, or a group of parts."""

TEXT = ZeroEndedText.TERMINATED
COUNT_SIZE = 4
POSITION = 12
ROTATION = 16


def minimum_size(part: Part) -> int:
    """Return the least number of bytes that a part takes."""
    if isinstance(part, int):
        return part
    if isinstance(part, tuple):
        return sum(map(minimum_size, part))
    return 1 if part is TEXT else COUNT_SIZE


BODY_SIZE = 4 + POSITION + ROTATION + 4 + 2  # id, pose, marker error, flags
MARKER_SIZE = 4 + POSITION + 4 + 2 + 4  # id, position, size, flags, residual
CHANNELS: Part = (4, Repeated(Repeated(4)))  # id, channels of samples


class Section(Enum):
    """Sections of a frame, each a count and that many elements."""

    MARKER_SETS = "marker sets"
    UNLABELED_MARKERS = "unlabeled markers"
    RIGID_BODIES = "rigid bodies"
    SKELETONS = "skeletons"
    ASSETS = "assets"
    LABELED_MARKERS = "labeled markers"
    FORCE_PLATES = "force plates"
    DEVICES = "devices"


ELEMENTS: dict[Section, Part] = {
    Section.MARKER_SETS: (TEXT, Repeated(POSITION)),
    Section.UNLABELED_MARKERS: POSITION,
    Section.RIGID_BODIES: BODY_SIZE,
    Section.SKELETONS: (4, Repeated(BODY_SIZE)),
    Section.ASSETS: (4, Repeated(BODY_SIZE), Repeated(MARKER_SIZE)),
    Section.LABELED_MARKERS: MARKER_SIZE,
    Section.FORCE_PLATES: CHANNELS,
    Section.DEVICES: CHANNELS,
}
"""Element of a section; equal in all versions that have the section."""

_WITHOUT_ASSETS = tuple(one for one in Section if one is not Section.ASSETS)

# Suffix: time code (8), time (8), three ticks (24), from 4.1 on a precise time (8),
# flags (2), a zero at the end (4) that not every server sends. Sources disagree
# whether 4.0 has the precise time, and the sizes tell the forms apart.
_PLAIN_SUFFIXES = (42, 46)
_PRECISE_SUFFIXES = (50, 54)

SUFFIX_TIME = 8
"""Bytes from the start of the suffix to its time."""
FLAGS_AT = {42: 40, 46: 40, 50: 48, 54: 48}
"""Bytes from the start of a suffix to its flags, by size of the suffix."""

_MARKER_DESCRIPTION: Part = (TEXT, 4, POSITION, 4, 2)
RIGID_BODY = 1
"""Type of the definition of a rigid body; it begins with name (text) and id (4)."""


def _definitions(body: Part) -> dict[int, Part]:
    """Return the definitions by type, for a definition of a rigid body."""
    return {
        0: (TEXT, Repeated(TEXT)),  # marker set
        RIGID_BODY: body,
        2: (TEXT, 4, Repeated(body)),  # skeleton
        3: (4, TEXT, 4, 4, POSITION, 576, 48, 4, 4, Repeated(TEXT)),  # force plate
        4: (4, TEXT, TEXT, 4, 4, Repeated(TEXT)),  # device
        5: (TEXT, POSITION, ROTATION),  # camera
        6: (TEXT, 4, 4, Repeated(body), Repeated(_MARKER_DESCRIPTION)),  # asset
    }


# name, id, parent, offset, then positions, labels and, from 4.0 on, names of markers
_BODY_3: Part = (TEXT, 4, 4, POSITION, Repeated(POSITION, 4))
_BODY_4: Part = (TEXT, 4, 4, POSITION, Repeated(POSITION, 4, TEXT))
# from 4.2 on, a rotation follows the offset
_BODY_42: Part = (TEXT, 4, 4, POSITION, ROTATION, Repeated(POSITION, 4, TEXT))


@dataclass(frozen=True)
class MessageLayout:
    """Layout of the messages of one version.

    Attributes:
        sections: of a frame, in their order.
        has_sizes: whether the number of bytes (4 bytes) follows the count of a section
            and the type of a definition.
        suffixes: allowed sizes of the suffix [bytes].
        definitions: by type.
    """

    sections: tuple[Section, ...]
    has_sizes: bool
    suffixes: tuple[int, ...]
    definitions: dict[int, Part]


LAYOUTS = {
    Version(3, 1): MessageLayout(
        _WITHOUT_ASSETS, False, _PLAIN_SUFFIXES, _definitions(_BODY_3)
    ),
    Version(4, 0): MessageLayout(
        _WITHOUT_ASSETS,
        False,
        _PLAIN_SUFFIXES + _PRECISE_SUFFIXES,
        _definitions(_BODY_4),
    ),
    Version(4, 1): MessageLayout(
        tuple(Section), True, _PRECISE_SUFFIXES, _definitions(_BODY_4)
    ),
    Version(4, 2): MessageLayout(
        tuple(Section), True, _PRECISE_SUFFIXES, _definitions(_BODY_42)
    ),
}
"""Layouts of the supported versions."""
