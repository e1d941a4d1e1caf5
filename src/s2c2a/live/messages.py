"""What a browser may say: three kinds of messages, of known form, with finite numbers. Everything else is refused.

viser itself would also take files, open a tunnel to the world when asked to, and set
any attribute of a panel's parts.
"""

from contextlib import suppress
from typing import Annotated, Literal, TypeAlias, TypeGuard

import msgspec
from msgspec.msgpack import Decoder

MAX_BYTES = 16_384
# neither infinite nor NaN
Number: TypeAlias = Annotated[float, msgspec.Meta(ge=-1e300, le=1e300)]
Pair: TypeAlias = tuple[Number, Number]
Three: TypeAlias = tuple[Number, Number, Number]
Value: TypeAlias = bool | int | Number | str | list[Number]


class _Said(
    msgspec.Struct, tag_field="type", tag=True, forbid_unknown_fields=True, frozen=True
):
    """A message; its class's name is its type."""


class ViewerCameraMessage(_Said, frozen=True):
    """Where a browser looks from."""

    wxyz: tuple[Number, Number, Number, Number]
    position: Three
    fov: Number
    near: Number
    far: Number
    image_height: int
    image_width: int
    look_at: Three
    up_direction: Three


class GuiUpdateMessage(_Said, frozen=True):
    """A new value of one part of a panel."""

    uuid: str
    updates: Annotated[dict[Literal["value"], Value], msgspec.Meta(min_length=1)]


class SceneNodeDragMessage(_Said, frozen=True):
    """Something in the scene is dragged."""

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


def is_sound(message: str | bytes) -> TypeGuard[bytes]:
    """Whether a browser's message may pass."""
    with suppress(msgspec.DecodeError, RecursionError, UnicodeDecodeError):
        if isinstance(message, bytes) and len(message) <= MAX_BYTES:
            _DECODER.decode(message)
            return True
    return False
