"""Messages that a browser may send: of known form, with finite numbers.

Three types go to viser; those of the steering connection do not.

All others are refused: viser itself also accepts files, opens a public tunnel on
request, and sets any attribute of a panel's elements.
"""

from contextlib import suppress
from typing import Annotated, Literal, TypeAlias, TypeGuard

import msgspec
from msgspec.msgpack import Decoder

MAX_BYTES = 16_384
Number: TypeAlias = Annotated[float, msgspec.Meta(ge=-1e300, le=1e300)]  # finite
Pair: TypeAlias = tuple[Number, Number]
Three: TypeAlias = tuple[Number, Number, Number]
Value: TypeAlias = bool | int | Number | str | list[Number]


class _Message(
    msgspec.Struct, tag_field="type", tag=True, forbid_unknown_fields=True, frozen=True
):
    """A message; the name of the class is its type."""


class ViewerCameraMessage(_Message, frozen=True):
    """Camera of a browser."""

    wxyz: tuple[Number, Number, Number, Number]
    position: Three
    fov: Number
    near: Number
    far: Number
    image_height: int
    image_width: int
    look_at: Three
    up_direction: Three


class GuiUpdateMessage(_Message, frozen=True):
    """New value of an element of a panel."""

    uuid: str
    updates: Annotated[dict[Literal["value"], Value], msgspec.Meta(min_length=1)]


class SceneNodeDragMessage(_Message, frozen=True):
    """Drag of an object in the scene."""

    phase: Literal["start", "update", "end"]
    name: str
    instance_index: int | None
    start_position: Three
    start_screen_pos: Pair
    end_position: Three
    end_screen_pos: Pair
    button: Literal["left", "middle", "right"]
    modifier: str | None
    owner: str = ""


_DECODER: Decoder = Decoder(
    ViewerCameraMessage | GuiUpdateMessage | SceneNodeDragMessage
)


Part: TypeAlias = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]


class SteeringMessage(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Keys or sticks that are held.

    Attributes:
        key: which the panel of the driver's browser holds.
        direction: to the right, forward and upward, each in parts of the largest speed.
    """

    key: Annotated[str, msgspec.Meta(max_length=64)]
    direction: tuple[Part, Part, Part]


def steering_of(message: str | bytes) -> SteeringMessage | None:
    """The message of a steering connection, or None if it may not pass."""
    with suppress(msgspec.DecodeError, RecursionError, UnicodeDecodeError):
        if len(message) <= MAX_BYTES:
            return msgspec.json.decode(message, type=SteeringMessage)
    return None


def is_valid(message: str | bytes) -> TypeGuard[bytes]:
    """Whether a browser's message may pass."""
    with suppress(msgspec.DecodeError, RecursionError, UnicodeDecodeError):
        if isinstance(message, bytes) and len(message) <= MAX_BYTES:
            _DECODER.decode(message)
            return True
    return False
