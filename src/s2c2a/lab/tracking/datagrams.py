"""Datagrams of poses as JSON: parsing, and the order of frames.

Pure functions and values, without sockets; `docs/guides/tracking.md` states the format.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from s2c2a.lab.tracking.poses import Pose, PoseError, TrackingError
from s2c2a.validation import describe_fault

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


class DatagramError(TrackingError):
    """A datagram is dropped.

    Attributes:
        reason: why.
    """

    def __init__(self, message: str, reason: DropReason):
        super().__init__(message)
        self.reason = reason

    def __reduce__(self):
        """Support pickling."""
        return type(self), (*self.args, self.reason)


@dataclass(frozen=True, eq=False)
class Datagram:
    """A valid datagram.

    Attributes:
        time: on the clock of the source [s].
        frame: number of the frame.
        poses: `T_world_body` by name [m].
    """

    time: float
    frame: int
    poses: Mapping[str, Pose]


class _Strict(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class _BodyMessage(_Strict):
    position: list[float] = Field(min_length=3, max_length=3)
    rotation: list[float] = Field(min_length=4, max_length=4)


class _Message(_Strict):
    time: float
    frame: int = Field(ge=0, le=MAX_FRAME)
    bodies: dict[
        Annotated[str, Field(min_length=1, max_length=64)], _BodyMessage | None
    ]
    units: Literal["m", "mm"] = "m"


def parse_datagram(content: bytes) -> Datagram:
    """Parse a datagram.

    Args:
        content: UTF-8 JSON.

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
    poses = {name: _pose(name, body, scale) for name, body in seen.items()}
    return Datagram(message.time, message.frame, poses)


def _parse_message(content: bytes) -> _Message:
    if len(content) > MAX_BYTES:
        raise DatagramError(
            f"more than {MAX_BYTES} bytes; send fewer bodies", DropReason.OVERSIZED
        )
    try:
        value = json.loads(content.decode(), object_pairs_hook=_without_duplicates)
        return _Message.model_validate(value)
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


def _pose(name: str, body: _BodyMessage, scale: float) -> Pose:
    position = [scale * coordinate for coordinate in body.position]
    try:
        return Pose.measured(position, body.rotation)
    except PoseError as error:
        raise DatagramError(f"{name}: {error}", DropReason.IMPLAUSIBLE) from error


@dataclass(frozen=True)
class _Last:
    """What is known of the newest frame."""

    sender: object
    arrival: float
    time: float
    frame: int


class FrameOrder:
    """Decides which datagrams are newer than all before, and when a sender restarts.

    A sender restarts when it is silent for a second, or when its clock steps back by
    more than a second and its frame numbers begin again. Only after a silence may
    another sender take over: two senders never mix.
    """

    def __init__(self) -> None:
        """An order before the first datagram."""
        self._last: _Last | None = None
        self.restarts = 0

    def accept(self, datagram: Datagram, arrival: float, sender: object = None) -> None:
        """Make a datagram the newest one.

        Args:
            datagram: to judge.
            arrival: on this computer's clock [s].
            sender: address of the sender, or any value that identifies it.

        Raises:
            DatagramError: it is late, a duplicate, or from a second sender.
        """
        last = self._last
        if last is not None:
            self._check(datagram, last, arrival, sender)
        self._last = _Last(sender, arrival, datagram.time, datagram.frame)

    def _check(
        self, datagram: Datagram, last: _Last, arrival: float, sender: object
    ) -> None:
        silent = arrival - last.arrival > RESTART_SILENCE
        if sender != last.sender and not silent:
            raise DatagramError(
                f"{last.sender} sends, too; stop one of them", DropReason.OTHER_SENDER
            )
        if (datagram.frame, datagram.time) == (last.frame, last.time):
            raise DatagramError("the same frame again", DropReason.DUPLICATE)
        if datagram.frame > last.frame and datagram.time >= last.time:
            return
        clock_reset = last.time - datagram.time > RESTART_SILENCE
        if not silent and not (clock_reset and datagram.frame < last.frame):
            self._refuse(datagram, last)
        self.restarts += 1

    def _refuse(self, datagram: Datagram, last: _Last) -> None:
        repeated = datagram.frame == last.frame
        raise DatagramError(
            f"frame {datagram.frame} at {datagram.time} s came after frame "
            f"{last.frame} at {last.time} s; count frames and time up",
            DropReason.DUPLICATE if repeated else DropReason.LATE,
        )
