"""What a browser may say: five kinds of messages, of known form, with finite numbers. Everything else is refused.

viser itself would also take files, open a tunnel to the world when asked to, and set any attribute of a panel's parts.
"""

import math
from typing import Any, Literal, TypeAlias, TypeGuard

import msgspec

MOST_BYTES = 16_384
Pair: TypeAlias = tuple[float, float]
Three: TypeAlias = tuple[float, float, float]
Four: TypeAlias = tuple[float, float, float, float]
Value: TypeAlias = bool | int | float | str | list[float]


class _Said(msgspec.Struct, tag_field="type", tag=True, forbid_unknown_fields=True, frozen=True):
    """A message; its class's name is its type."""


class ViewerCameraMessage(_Said, frozen=True):
    """Where a browser looks from."""

    wxyz: Four
    position: Three
    fov: float
    near: float
    far: float
    image_height: int
    image_width: int
    look_at: Three
    up_direction: Three


class _NewValue(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    value: Value


class GuiUpdateMessage(_Said, frozen=True):
    """A new value of one part of a panel."""

    uuid: str
    updates: _NewValue


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


class SceneNodeClickMessage(_Said, frozen=True):
    """Something in the scene is clicked."""

    name: str
    instance_index: int | None
    ray_origin: Three
    ray_direction: Three
    screen_pos: Pair
    modifier: str | None
    owner: str = ""


class GuiButtonHoldMessage(_Said, frozen=True):
    """A button is held."""

    uuid: str
    frequency: float


_DECODER: msgspec.msgpack.Decoder = msgspec.msgpack.Decoder(
    ViewerCameraMessage | GuiUpdateMessage | SceneNodeDragMessage | SceneNodeClickMessage | GuiButtonHoldMessage
)


def is_sound(message: str | bytes) -> TypeGuard[bytes]:
    """Whether a browser's message may pass."""
    if not isinstance(message, bytes) or len(message) > MOST_BYTES:
        return False
    try:
        said = _DECODER.decode(message)
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError):
        return False
    return _finite(msgspec.to_builtins(said))


def _finite(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, dict):
        return all(_finite(one) for one in value.values())
    if isinstance(value, list | tuple):
        return all(_finite(one) for one in value)
    return True
