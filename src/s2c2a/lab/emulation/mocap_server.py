"""What all emulated motion capture shares: schedule, faults, queue of frames."""

import heapq
import math
import socket
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.fault_texts import (
    MAYBE_SECONDS,
    SECONDS,
    SHARE,
    Argument,
    Fault,
    FaultGrammar,
    FaultShares,
)
from s2c2a.lab.emulation.plant import FramePose
from s2c2a.lab.emulation.tracked_bodies import Bodies, TrackedBodies

_LONGEST_GARBAGE = 300  # bytes
_REORDERING = 1.5  # frames; later than the next frame, earlier than the one after it
_NOISE_STREAM = 15

_BODY = Argument("BODY", high=None)
KINDS: dict[str, tuple[Argument, ...]] = {
    "lost": (SHARE,),
    "late": (SECONDS, SHARE),
    "reordered": (SHARE,),
    "duplicated": (SHARE,),
    "garbage": (SHARE,),
    "incomplete": (SHARE,),
    "absurd": (SHARE,),
    "hidden": (_BODY, MAYBE_SECONDS),
    "frozen": (_BODY, MAYBE_SECONDS),
    "swapped": (_BODY, _BODY),
    "flipped": (_BODY,),
    "millimeters": (),
    "knocked": (Argument("METERS", high=1.0),),
    "restart": (SECONDS,),
    "drift": (Argument("PPM", -1e5, 1e5),),
}
"""Kinds of faults and their arguments.

lost, late, reordered, duplicated, garbage: share of the frames that are lost, come
later, come after the next one, come twice, are followed by a damaged copy; incomplete:
lack a part; absurd: have a body with impossible numbers; from then on, until the kind
comes again with share 0. hidden: the body is not tracked, for good or for a time.
frozen: its last pose comes again as if it were tracked, for good or for a time.
swapped: two bodies have each other's poses; flipped: a body is turned by 180 deg about
its x axis; millimeters: positions are in mm, against the protocol; until the kind comes
again. knocked: the world frame shifts along x, for good. restart: the program is off
for a time and forgets its clients; its clock begins again. drift: its clock
runs faster than that of this computer.
"""
SHARE_KINDS = frozenset(
    ("lost", "late", "reordered", "duplicated", "garbage", "incomplete", "absurd")
)
"""Kinds that act on a share of the frames."""


GRAMMAR = FaultGrammar("a fault of motion capture", "body", KINDS, "3 hidden end-2 1.5")

PoseSource = Callable[[], Mapping[str, FramePose]]


@dataclass(frozen=True)
class StreamOptions:
    """Options of every stream.

    Attributes:
        up: vertical axis of the stream, "y" or "z".
        rate: frames a second [Hz].
        noise: standard deviation of positions [m].
        latency: from exposure to transmission [s].
        faults: as texts (`GRAMMAR`).
        host: address on which it listens.
        seed: of noise and faults.
    """

    up: str = "y"
    rate: float = 120.0
    noise: float = 0.0
    latency: float = 0.0
    faults: tuple[str, ...] = ()
    host: str = "127.0.0.1"
    seed: int = 0

    def __post_init__(self):
        require(self.up in ("y", "z"), "up", self.up, "y or z")
        require(1 <= self.rate <= 1000, "rate", self.rate, "1 to 1000 Hz")
        require(0 <= self.noise <= 1, "noise", self.noise, "0 to 1 m")
        require(0 <= self.latency <= 10, "latency", self.latency, "0 to 10 s")


def require(is_valid: bool, name: str, value: object, allowed: str) -> None:
    """Check an option.

    Raises:
        S2C2AError: it is not valid.
    """
    if not is_valid:
        raise S2C2AError(f"{name} {value!r} is not allowed; give {allowed}")


OptionsType = TypeVar("OptionsType", bound=StreamOptions)


def bound_socket(kind: socket.SocketKind, host: str, port: int) -> socket.socket:
    """Return a socket that receives, and does not block.

    Raises:
        S2C2AError: the port is taken, or the address is not of this computer.
    """
    opened = socket.socket(socket.AF_INET, kind)
    is_stream = kind is socket.SOCK_STREAM
    try:
        if is_stream:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.bind((host, port))
        if is_stream:
            opened.listen()
    except (OSError, OverflowError) as error:  # the latter: there is no such port
        opened.close()
        raise S2C2AError(
            f"cannot listen on {'TCP' if is_stream else 'UDP'} {host}:{port}: {error}; "
            "close the program that listens there, or choose another port"
        ) from error
    opened.setblocking(False)
    return opened


class MocapServer(ABC, Generic[OptionsType]):
    """Server of one stream; `serve` does what is due, and never waits.

    A subclass knows the protocol. Faults act on the bodies before a frame is encoded,
    and on the frames in the queue.

    Attributes:
        options: of the stream.
        frame_count: frames since the start.
        drift: of the clock [s/s].
    """

    def __init__(self, names: Sequence[str], options: OptionsType):
        """A server that is not open yet.

        Args:
            names: of the rigid bodies.
            options: of the stream.

        Raises:
            S2C2AError: a fault is invalid.
        """
        self.options = options
        self._names = list(names)
        self._pending = GRAMMAR.parse(options.faults, self._names)
        self._random = np.random.default_rng([options.seed, _NOISE_STREAM])
        self._bodies = TrackedBodies(
            self._names, options.noise, options.up, self._random
        )
        self._sockets: list[socket.socket] = []
        self._queue: list[tuple[float, int, bytes]] = []
        self._queued = 0
        self._shares = FaultShares(self._random)
        self._boot_time = 0.0
        self._next_frame = 0.0
        self.frame_count = 0
        self.drift = 0.0

    @property
    def files(self) -> list[socket.socket]:
        """Sockets on which requests arrive; empty while the server is closed."""
        return self._sockets[:1]

    @property
    @abstractmethod
    def label(self) -> str:
        """Program, protocol and addresses, for messages."""

    @abstractmethod
    def _open(self) -> list[socket.socket]:
        """Return new sockets, first the one on which requests arrive."""

    def _forget_clients(self) -> None:
        """Forget all clients."""

    def _answer_requests(self, now: float) -> None:
        """Answer what has arrived."""

    @abstractmethod
    def _encode(self, number: int, time: float, bodies: Bodies) -> bytes:
        """Return a frame of data."""

    @abstractmethod
    def _without_part(self, content: bytes) -> bytes:
        """Return a frame that lacks a part."""

    @abstractmethod
    def _send_frame(self, content: bytes, now: float) -> None:
        """Send a frame to all clients."""

    def open(self) -> None:
        """Listen for requests.

        Raises:
            S2C2AError: the port is taken, or the address is not of this computer.
        """
        if not self._sockets:
            self._sockets = self._open()

    def close(self) -> None:
        """Stop listening; allowed more than once."""
        for opened in self._sockets:
            opened.close()
        self._sockets = []
        self._forget_clients()
        self._queue.clear()

    @property
    def next_time(self) -> float:
        """Time at which `serve` is due again [s]."""
        sending = self._queue[0][0] if self._queue else math.inf
        return min(self._next_frame, sending)

    def serve(self, now: float, poses: PoseSource) -> None:
        """Apply faults, answer requests, send frames that are due.

        Args:
            now: time since the start [s].
            poses: returns `T_world_body` by name, z up.
        """
        while self._pending and self._pending[0].time <= now:
            self._apply(self._pending.pop(0), now)
        if now < self._boot_time:
            return
        self.open()
        self._answer_requests(now)
        if now >= self._next_frame:
            period = 1 / self.options.rate
            self._next_frame = max(self._next_frame + period, now)
            self._publish(now, poses())
        while self._queue and self._queue[0][0] <= now:
            _, _, content = heapq.heappop(self._queue)
            self._send_frame(content, now)

    def _apply(self, fault: Fault, now: float) -> None:
        if fault.kind in SHARE_KINDS:
            self._shares.values[fault.kind] = fault.values
        elif fault.kind == "drift":
            self.drift = fault.values[0] * 1e-6
        elif fault.kind == "restart":
            self._restart(now + fault.values[0])
        else:
            self._bodies.apply(fault, now)

    def _restart(self, boot_time: float) -> None:
        self.close()
        self._boot_time = boot_time
        self._next_frame = boot_time
        self.frame_count = 0

    def _publish(self, now: float, poses: Mapping[str, FramePose]) -> None:
        """Encode the poses and queue the frame."""
        time = (now - self._boot_time) * (1 + self.drift)
        bodies = self._bodies.see(poses, now)
        if self._shares.hits("absurd"):
            bodies = self._bodies.corrupt(bodies)
        content = self._encode(self.frame_count, time, bodies)
        self.frame_count += 1
        if self._shares.hits("incomplete"):
            content = self._without_part(content)
        self._queue_disturbed(content, now + self.options.latency)

    def _queue_disturbed(self, content: bytes, due: float) -> None:
        if self._shares.hits("lost"):
            return
        if self._shares.hits("late"):
            due += self._shares.values["late"][0]
        if self._shares.hits("reordered"):
            due += _REORDERING / self.options.rate
        self._push(due, content)
        if self._shares.hits("duplicated"):
            self._push(due, content)
        if self._shares.hits("garbage"):
            self._push(due, self._damage(content))

    def _damage(self, content: bytes) -> bytes:
        """Return a frame that lacks a part, or random bytes."""
        if self._random.random() < 0.5:
            return self._without_part(content)
        return self._random.bytes(int(self._random.integers(_LONGEST_GARBAGE)))

    def _push(self, due: float, content: bytes) -> None:
        heapq.heappush(self._queue, (due, self._queued, content))
        self._queued += 1
