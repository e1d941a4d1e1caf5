"""Emulated OptiTrack Motive: streams rigid bodies by NatNet, with faults."""

import heapq
import math
import socket
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from s2c2a.emulation import natnet_protocol as protocol
from s2c2a.emulation.motive_faults import (
    NETWORK_KINDS,
    MotiveFault,
    parse_motive_faults,
)
from s2c2a.emulation.natnet_protocol import VERSIONS, StreamedBody
from s2c2a.emulation.plant import Pose
from s2c2a.errors import S2C2AError

if TYPE_CHECKING:
    from s2c2a.emulation.emulator import Emulator

_CLIENT_TIMEOUT = 10.0  # s; a client that does not keep itself alive is forgotten
_MAX_CLIENTS = 16
_LONGEST_REQUEST = 2048  # bytes
_LONGEST_GARBAGE = 300  # bytes
_REORDERING = 1.5  # frames; later than the next frame, earlier than the one after it
_NOISE_STREAM = 15

PoseSource = Callable[[], Mapping[str, Pose]]


@dataclass(frozen=True)
class MotiveOptions:
    """Options of an emulated Motive.

    Attributes:
        version: of NatNet; one of `natnet_protocol.VERSIONS`.
        up: vertical axis of the stream, "y" or "z".
        rate: frames a second [Hz].
        noise: standard deviation of positions [m].
        latency: from exposure to transmission [s].
        faults: as texts (`motive_faults.EXAMPLE`).
        host: address on which it listens.
        command_port: for requests.
        data_port: of the frames, for multicast.
        multicast: group of the frames; empty: unicast to clients that connect.
        seed: of noise and faults.
    """

    version: str = "4.1"
    up: str = "y"
    rate: float = 120.0
    noise: float = 0.0
    latency: float = 0.0
    faults: tuple[str, ...] = ()
    host: str = "127.0.0.1"
    command_port: int = 1510
    data_port: int = 1511
    multicast: str = ""
    seed: int = 0

    def __post_init__(self):
        _require(self.version in VERSIONS, "version", self.version, ", ".join(VERSIONS))
        _require(self.up in ("y", "z"), "up", self.up, "y or z")
        _require(1 <= self.rate <= 1000, "rate", self.rate, "1 to 1000 Hz")
        _require(0 <= self.noise <= 1, "noise", self.noise, "0 to 1 m")
        _require(0 <= self.latency <= 10, "latency", self.latency, "0 to 10 s")
        for name in ("command_port", "data_port"):
            port = getattr(self, name)
            _require(0 < port < 65_536, name, port, "1 to 65535")
        _require(
            not self.multicast or _is_group(self.multicast),
            "multicast",
            self.multicast,
            "a group such as 239.255.42.99",
        )


def _require(is_valid: bool, name: str, value: object, allowed: str) -> None:
    if not is_valid:
        raise S2C2AError(f"{name} {value!r} is not allowed; give {allowed}")


def _is_group(text: str) -> bool:
    try:
        return 224 <= socket.inet_aton(text)[0] < 240 and text.count(".") == 3
    except OSError:
        return False


def to_stream(pose: Pose, up: str) -> Pose:
    """Return a pose of a world with z up in the axes of the stream.

    With y up, (x, y, z) becomes (x, z, -y), also in the vector of the quaternion.
    """
    if up == "z":
        return pose
    x, y, z, w = pose.rotation
    rotation = np.array([x, z, -y, w])
    (x, y, z) = pose.position
    return Pose(np.array([x, z, -y]), rotation)


class Motive:
    """Server of one stream; `serve` does what is due, and never waits.

    Attributes:
        options: of the stream.
        frame_count: frames since the start.
        drift: of the clock [s/s].
    """

    def __init__(self, names: Sequence[str], options: MotiveOptions):
        """A server that is not open yet.

        Args:
            names: of the rigid bodies, whose ids count from 1.
            options: of the stream.

        Raises:
            S2C2AError: a fault is invalid.
        """
        self.options = options
        self._names = list(names)
        self._pending = parse_motive_faults(options.faults, self._names)
        self._random = np.random.default_rng([options.seed, _NOISE_STREAM])
        self._sockets: tuple[socket.socket, socket.socket] | None = None
        self._clients: dict[tuple[str, int], float] = {}
        self._queue: list[tuple[float, int, bytes]] = []
        self._queued = 0
        self._disturbances: dict[str, tuple[float, ...]] = {}
        self._hidden: dict[str, float] = {}
        self._swapped: set[frozenset[str]] = set()
        self._seen: dict[str, Pose] = {}
        self._boot_time = 0.0
        self._next_frame = 0.0
        self.frame_count = 0
        self.drift = 0.0

    def open(self) -> None:
        """Listen for requests.

        Raises:
            S2C2AError: the port is taken, or the address is not of this computer.
        """
        host = self.options.host
        commands = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        data = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            commands.bind((host, self.options.command_port))
            data.bind((host, 0))
            interface = socket.inet_aton(socket.gethostbyname(host))
            data.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
        except OSError as error:
            commands.close()
            data.close()
            raise S2C2AError(
                f"cannot listen on UDP {host}:{self.options.command_port}: {error}; "
                "close the program that listens there, or choose another port"
            ) from error
        commands.setblocking(False)
        data.setblocking(False)
        self._sockets = (commands, data)

    def close(self) -> None:
        """Stop listening; allowed more than once."""
        for opened in self._sockets or ():
            opened.close()
        self._sockets = None
        self._clients.clear()
        self._queue.clear()

    @property
    def files(self) -> list[socket.socket]:
        """Sockets on which requests arrive."""
        return [self._sockets[0]] if self._sockets is not None else []

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
        if self._sockets is None:
            self.open()
        self._answer_requests(now)
        if now >= self._next_frame:
            period = 1 / self.options.rate
            self._next_frame = max(self._next_frame + period, now)
            self._publish(now, poses())
        self._send_queued(now)

    def _apply(self, fault: MotiveFault, now: float) -> None:
        if fault.kind in NETWORK_KINDS:
            self._disturbances[fault.kind] = fault.values
        elif fault.kind == "hidden":
            seconds = fault.values[0] if fault.values else math.inf
            self._hidden[fault.bodies[0]] = now + seconds
        elif fault.kind == "swapped":
            self._swapped ^= {frozenset(fault.bodies)}
        elif fault.kind == "drift":
            self.drift = fault.values[0] * 1e-6
        elif fault.kind == "restart":
            self._restart(now + fault.values[0])

    def _restart(self, boot_time: float) -> None:
        self.close()
        self._boot_time = boot_time
        self._next_frame = boot_time
        self.frame_count = 0

    def _answer_requests(self, now: float) -> None:
        (commands,) = self.files
        while True:
            try:
                data, client = commands.recvfrom(_LONGEST_REQUEST)
            # nothing is left; or, on Windows, a client has left or sent too much
            except OSError:
                return
            answer = self._answer(data, client, now)
            if answer:
                self._send(commands, answer, client)

    def _answer(self, data: bytes, client: tuple[str, int], now: float) -> bytes:
        """Return the answer to a request; empty: none."""
        options = self.options
        kind, content = protocol.unpack(data)
        if kind == protocol.CONNECT:
            if len(self._clients) < _MAX_CLIENTS:
                self._clients[client] = now
            return protocol.encode_server_info(
                options.version, options.data_port, options.multicast
            )
        if kind == protocol.REQUEST_DEFINITIONS:
            return protocol.encode_definitions(options.version, self._names)
        if kind == protocol.KEEP_ALIVE and client in self._clients:
            self._clients[client] = now
        if kind == protocol.REQUEST and content:
            return protocol.pack(protocol.UNRECOGNIZED, b"")
        return b""

    def _publish(self, now: float, poses: Mapping[str, Pose]) -> None:
        """Encode the poses and queue the frame."""
        time = (now - self._boot_time) * (1 + self.drift)
        content = protocol.encode_frame(
            self.options.version,
            self.frame_count,
            time,
            self._streamed_bodies(now, poses),
            self.options.latency,
        )
        self.frame_count += 1
        self._queue_disturbed(content, now + self.options.latency)

    def _streamed_bodies(
        self, now: float, poses: Mapping[str, Pose]
    ) -> dict[str, StreamedBody]:
        poses = dict(poses)
        for pair in self._swapped:
            (first, second) = pair
            poses[first], poses[second] = poses[second], poses[first]
        return {name: self._stream(name, poses[name], now) for name in self._names}

    def _stream(self, name: str, pose: Pose, now: float) -> StreamedBody:
        """Return a body with noise; a hidden one where it was seen last."""
        if now < self._hidden.get(name, -math.inf):
            return StreamedBody(self._seen.get(name, pose), is_tracked=False)
        noise = self._random.normal(0.0, self.options.noise, 3)
        noisy = replace(pose, position=pose.position + noise)
        self._seen[name] = to_stream(noisy, self.options.up)
        return StreamedBody(self._seen[name])

    def _queue_disturbed(self, content: bytes, due: float) -> None:
        if self._hits("lost"):
            return
        if self._hits("late"):
            due += self._disturbances["late"][0]
        if self._hits("reordered"):
            due += _REORDERING / self.options.rate
        self._push(due, content)
        if self._hits("duplicated"):
            self._push(due, content)
        if self._hits("garbage"):
            self._push(due, self._damage(content))

    def _hits(self, kind: str) -> bool:
        values = self._disturbances.get(kind)
        return values is not None and self._random.random() < values[-1]

    def _damage(self, content: bytes) -> bytes:
        """Return the beginning of a message, or random bytes."""
        if self._random.random() < 0.5:
            return content[: self._random.integers(len(content))]
        return self._random.bytes(int(self._random.integers(_LONGEST_GARBAGE)))

    def _push(self, due: float, content: bytes) -> None:
        heapq.heappush(self._queue, (due, self._queued, content))
        self._queued += 1

    def _send_queued(self, now: float) -> None:
        while self._queue and self._queue[0][0] <= now:
            _, _, content = heapq.heappop(self._queue)
            self._send_frame(content, now)

    def _send_frame(self, content: bytes, now: float) -> None:
        if self._sockets is None:
            return
        _, data = self._sockets
        if self.options.multicast:
            address = (self.options.multicast, self.options.data_port)
            self._send(data, content, address)
            return
        for client, last_request in list(self._clients.items()):
            if now - last_request > _CLIENT_TIMEOUT:
                del self._clients[client]
            else:
                self._send(data, content, client)

    def _send(
        self, sender: socket.socket, content: bytes, address: tuple[str, int]
    ) -> None:
        # a client that has left, or a full buffer, is no error of Motive
        with suppress(OSError):
            sender.sendto(content, address)


class MotiveOutput:
    """Motive that tracks the arm of emulated servos."""

    def __init__(self, names: Sequence[str], options: MotiveOptions):
        """Listen for requests.

        Args:
            names: of the rigid bodies.
            options: of the stream.

        Raises:
            S2C2AError: a port is taken.
        """
        self._motive = Motive(names, options)
        self._motive.open()

    @property
    def next_time(self) -> float:
        """Time at which `write` is due again [s]."""
        return self._motive.next_time

    def write(self, emulator: "Emulator", now: float) -> None:
        """Answer requests and send the frames that are due."""
        self._motive.serve(now, emulator.plant.poses)

    def close(self) -> None:
        """Stop listening."""
        self._motive.close()
