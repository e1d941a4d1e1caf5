"""Datagrams of poses as JSON: parsing; named poses and the order of frames of any stream.

Pure functions and values, without sockets; `docs/guides/tracking.md` states the format.
"""

import json
import math
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from s2c2a.files.validation import describe_fault
from s2c2a.lab.tracking.poses import Pose, PoseError
from s2c2a.lab.tracking.tracker import DropError, PoseFrame

MAX_BYTES = 16_384
"""Largest datagram [bytes]; a body takes about 150."""
MAX_FRAME = 2**63 - 1
RESTART_SILENCE = 1.0
"""Silence, or step of the source's clock backwards, of a sender that restarts [s]."""
SCALES = {"m": 1.0, "mm": 1e-3}


class DropReason(Enum):
    """Reasons for which a datagram is dropped."""

    OVERSIZED = "larger than 16,384 bytes"
    MALFORMED = "not of the documented form"
    IMPLAUSIBLE = "not finite, more than 100 m away, or not a unit quaternion"
    DUPLICATE = "the frame that came before"
    LATE = "older than a frame that came before"
    OTHER_SENDER = "from a second sender"
    EARLY = "before the version and the names of the bodies are known"
    FAILED = "failed in the receiver; please report it"


class DatagramError(DropError):
    """A datagram is dropped."""


class _Strict(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class _BodyMessage(_Strict):
    position: list[float] = Field(min_length=3, max_length=3)
    rotation: list[float] = Field(min_length=4, max_length=4)


class _PoseMessage(_Strict):
    time: float
    frame: int = Field(ge=0, le=MAX_FRAME)
    bodies: dict[
        Annotated[str, Field(min_length=1, max_length=64)], _BodyMessage | None
    ]
    units: Literal["m", "mm"] = "m"


def parse_datagram(content: bytes, arrival: float) -> PoseFrame:
    """Parse a datagram.

    Args:
        content: UTF-8 JSON.
        arrival: on this computer's clock [s].

    Raises:
        DatagramError: it is oversized, malformed or implausible.
    """
    message = _parse_message(content)
    if not math.isfinite(message.time):
        raise DatagramError(
            f"time is {message.time}; send seconds", DropReason.IMPLAUSIBLE
        )
    scale = SCALES[message.units]
    seen = {name: body for name, body in message.bodies.items() if body is not None}

    def pose_of(body: _BodyMessage) -> Pose:
        position = [scale * coordinate for coordinate in body.position]
        return Pose.measured(position, body.rotation)

    poses = named_poses(seen, pose_of)
    return PoseFrame(arrival, message.time, message.frame, poses)


def _parse_message(content: bytes) -> _PoseMessage:
    if len(content) > MAX_BYTES:
        raise DatagramError(
            f"more than {MAX_BYTES} bytes; send fewer bodies", DropReason.OVERSIZED
        )
    try:
        value = json.loads(content.decode(), object_pairs_hook=_without_duplicates)
        return _PoseMessage.model_validate(value)
    except ValidationError as error:
        raise DatagramError(_explain(error), DropReason.MALFORMED) from error
    # ValueError: no JSON, no UTF-8, a repeated key, an integer of thousands of digits
    except (ValueError, RecursionError) as error:
        raise DatagramError(
            f"not JSON: {error}; send one object", DropReason.MALFORMED
        ) from error


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        raise ValueError("a key occurs twice")
    return values


def _explain(error: ValidationError) -> str:
    fault = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in fault["loc"]) or "datagram"
    return f"{key:.200}: {describe_fault(fault)}"


def named_poses(
    bodies: Mapping[str, Any], pose_of: Callable[[Any], Pose]
) -> dict[str, Pose]:
    """Return the poses of bodies by name.

    Args:
        bodies: as a stream has them, by name.
        pose_of: returns the pose of one body, or raises `PoseError`.

    Raises:
        DatagramError: a pose is implausible.
    """
    poses = {}
    for name, body in bodies.items():
        try:
            poses[name] = pose_of(body)
        except PoseError as error:
            raise DatagramError(f"{name}: {error}", DropReason.IMPLAUSIBLE) from error
    return poses


class FrameOrder:
    """Decides which frames are newer than all before, and when a sender restarts.

    A sender restarts when it is silent for a second, or when its clock steps back by
    more than a second and its frame numbers begin again. Only after a silence may
    another sender take over: two senders never mix.
    """

    def __init__(self, by_time: bool = False) -> None:
        """An order before the first frame.

        Args:
            by_time: whether the source's time alone decides, and numbers only between
                frames of one time, because the source may not count its frames.
        """
        self._by_time = by_time
        self._last: PoseFrame | None = None
        self._sender: object = None
        self.restarts = 0

    def accept(self, frame: PoseFrame, sender: object = None) -> None:
        """Make a frame the newest one.

        Args:
            frame: to judge.
            sender: address of the sender, or any value that identifies it.

        Raises:
            DatagramError: it is late, a duplicate, or from a second sender.
        """
        if self._last is not None:
            self._check(frame, self._last, sender)
        self._last = frame
        self._sender = sender

    def _check(self, frame: PoseFrame, last: PoseFrame, sender: object) -> None:
        silent = frame.arrival_time - last.arrival_time > RESTART_SILENCE
        if sender != self._sender and not silent:
            raise DatagramError(
                f"{self._sender} sends, too; stop one of them", DropReason.OTHER_SENDER
            )
        elapsed = frame.source_time - last.source_time
        if frame.number == last.number and elapsed == 0:
            raise DatagramError("the same frame again", DropReason.DUPLICATE)
        counted = frame.number - last.number
        if (counted > 0 and elapsed >= 0) or (self._by_time and elapsed > 0):
            return
        clock_reset = -elapsed > RESTART_SILENCE
        if not silent and not (clock_reset and (counted < 0 or self._by_time)):
            repeated = frame.number == last.number and not self._by_time
            raise DatagramError(
                f"frame {frame.number} at {frame.source_time} s came after frame "
                f"{last.number} at {last.source_time} s; count frames and time up",
                DropReason.DUPLICATE if repeated else DropReason.LATE,
            )
        self.restarts += 1
