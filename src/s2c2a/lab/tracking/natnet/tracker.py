"""Poses of rigid bodies from OptiTrack Motive."""

import select
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from threading import Event, Thread

from s2c2a.lab.tracking.datagrams import Datagram, DatagramError, DropReason, FrameOrder
from s2c2a.lab.tracking.hosts import resolve
from s2c2a.lab.tracking.natnet.axes import check_up_axis, z_up_pose
from s2c2a.lab.tracking.natnet.connection import Connection
from s2c2a.lab.tracking.natnet.messages import (
    MAX_MESSAGE,
    Frame,
    MessageKind,
    Reader,
    encode_request,
    parse_definitions,
    parse_frame,
    parse_server_info,
    split_message,
)
from s2c2a.lab.tracking.natnet.sockets import open_command_socket, open_group_socket
from s2c2a.lab.tracking.poses import Pose, PoseError, TrackingError
from s2c2a.lab.tracking.tracker import PoseFrame, Tracker
from s2c2a.lab.tracking.udp import (
    ERROR_PAUSE,
    LOCALHOST,
    MAX_PORT,
    DatagramCounts,
)

COMMAND_PORT = 1510
DATA_PORT = 1511
CONNECT_TIMEOUT = 5.0  # [s]
POLL_PERIOD = 0.05  # [s]; requests are late by no more, and `close` waits no longer


class NatNetTracker(Tracker):
    """Receives the rigid bodies of Motive by NatNet 3.1, 4.0 or 4.1.

    A thread connects, receives, and connects again when Motive restarts. A body that
    Motive does not track is absent from the poses. The world frame has the z axis up.
    Every frame that is not valid, plausible and newer than all before is counted and
    dropped.
    """

    def __init__(
        self,
        host: str = LOCALHOST,
        local: str = LOCALHOST,
        multicast: str | None = None,
        command_port: int = COMMAND_PORT,
        data_port: int = DATA_PORT,
        up: str = "y",
        timeout: float = CONNECT_TIMEOUT,
    ):
        """A tracker that does not receive yet.

        Args:
            host: computer with Motive.
            local: address of this computer in the network of Motive.
            multicast: group of the frames; None: unicast, or the group that Motive
                states.
            command_port: of Motive, for requests.
            data_port: of the frames, for multicast.
            up: vertical axis of the stream, "y" or "z", as set in Motive.
            timeout: time that `start` waits for Motive [s].

        Raises:
            TrackingError: a port or the axis does not exist.
        """
        for port in (command_port, data_port):
            if not 0 < port <= MAX_PORT:
                raise TrackingError(f"UDP port {port}; choose 1 to {MAX_PORT}")
        check_up_axis(up)
        self._host = host
        self._local = local
        self._multicast = multicast
        self._command_port = command_port
        self._data_port = data_port
        self._up = up
        self._timeout = timeout
        self._sockets: list[socket.socket] = []
        self._thread: Thread | None = None
        self._stop = Event()
        self._reset()

    def _reset(self) -> None:
        self._latest: PoseFrame | None = None
        self._connection = Connection(f"{self._host}:{self._command_port}")
        self._settled = Event()
        self._order = FrameOrder()
        self._accepted = 0
        self._dropped = dict.fromkeys(DropReason, 0)

    @property
    def counts(self) -> DatagramCounts:
        """Numbers of accepted frames and of dropped datagrams."""
        dropped = self._dropped.copy()
        return DatagramCounts(self._accepted, dropped, self._order.restarts)

    @property
    def problem(self) -> str:
        """See `Tracker`."""
        return self._connection.problem

    @property
    def bodies(self) -> list[str]:
        """Names of the rigid bodies in Motive; empty before the connection."""
        return sorted((self._connection.names or {}).values())

    def start(self) -> None:
        """See `Tracker`.

        Raises:
            TrackingError: Motive does not answer, streams an unsupported version, or an
                address is invalid.
        """
        if self._thread is not None:
            return
        self._server = resolve(self._host)
        self._sockets = [open_command_socket(self._local)]
        self._stop = Event()
        self._reset()
        try:
            if self._multicast is not None:
                self._join(self._multicast, self._data_port)
            self._connect()
        except BaseException:
            self.close()
            raise

    def _connect(self) -> None:
        """Start the thread and wait for the handshake."""
        self._thread = Thread(
            target=self._receive,
            args=(self._stop,),
            name="natnet-receiver",
            daemon=True,
        )
        self._thread.start()
        self._settled.wait(self._timeout)
        if not self._connection.is_connected:
            raise TrackingError(self.problem)

    def latest(self) -> PoseFrame | None:
        """See `Tracker`."""
        return self._latest

    def close(self) -> None:
        """See `Tracker`."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        for opened in self._sockets:
            opened.close()
        self._thread = None
        self._sockets = []

    def _join(self, group: str, port: int) -> None:
        self._sockets.append(open_group_socket(group, port, self._local))

    def _receive(self, stop: Event) -> None:
        while not stop.is_set():
            # the thread outlives every failure: a dead one looks like a lost source
            try:
                self._send_request(time.perf_counter())
                self._receive_waiting()
            except Exception:
                self._dropped[DropReason.FAILED] += 1
                stop.wait(ERROR_PAUSE)

    def _send_request(self, now: float) -> None:
        kind = self._connection.due_request(now)
        if kind is None:
            return
        address = (self._server, self._command_port)
        # the network may come back; until then `problem` states that there is no answer
        with suppress(OSError):
            self._sockets[0].sendto(encode_request(kind), address)

    def _receive_waiting(self) -> None:
        """Handle one datagram of every socket that has one."""
        ready, _, _ = select.select(self._sockets, [], [], POLL_PERIOD)
        for receiver in ready:
            try:
                content, sender = receiver.recvfrom(MAX_MESSAGE)
                self._handle(content, sender[0], time.perf_counter())
            except DatagramError as error:
                self._dropped[error.reason] += 1
            # Windows reports a port without a listener here
            except ConnectionError:
                self._stop.wait(ERROR_PAUSE)

    def _handle(self, content: bytes, sender: str, arrival: float) -> None:
        """Use a datagram, or raise `DatagramError`."""
        if sender != self._server:
            raise DatagramError(
                f"{sender} is not the computer with Motive", DropReason.OTHER_SENDER
            )
        kind, reader = split_message(content)
        if kind == MessageKind.FRAME:
            self._take_frame(reader, sender, arrival)
        elif kind == MessageKind.SERVER_INFO:
            self._take_server_info(reader, arrival)
        elif kind == MessageKind.DEFINITIONS:
            self._take_definitions(reader, arrival)

    def _take_server_info(self, reader: Reader, arrival: float) -> None:
        info = parse_server_info(reader)
        self._connection.take_server_info(info, arrival)
        if self._connection.layout is None:
            self._settled.set()
        elif info.group is not None and len(self._sockets) == 1:
            self._join_stated(info.group)

    def _join_stated(self, group: tuple[str, int]) -> None:
        """Join the group that Motive states."""
        try:
            self._join(*group)
        except TrackingError as error:
            self._connection.problem = str(error)

    def _take_definitions(self, reader: Reader, arrival: float) -> None:
        layout = self._connection.layout
        if layout is not None:
            names = parse_definitions(reader, layout)
            self._connection.take_definitions(names, arrival)
            self._settled.set()

    def _take_frame(self, reader: Reader, sender: str, arrival: float) -> None:
        connection = self._connection
        if connection.layout is None or connection.names is None:
            connection.request_soon(arrival)
            raise DatagramError("the version is not known yet", DropReason.EARLY)
        frame = parse_frame(reader, connection.layout)
        poses = self._named_poses(frame, connection.names)
        datagram = Datagram(frame.time, frame.number, poses)
        restarts = self._order.restarts
        self._order.accept(datagram, arrival, sender)
        is_known = all(body.id in connection.names for body in frame.bodies)
        restarted = self._order.restarts > restarts
        if frame.models_changed or restarted or not is_known:
            connection.request_definitions(arrival)
        connection.take_frame(arrival)
        self._latest = PoseFrame(arrival, frame.time, frame.number, poses)
        self._accepted += 1

    def _named_poses(self, frame: Frame, names: Mapping[int, str]) -> dict[str, Pose]:
        """Return the poses of the tracked bodies that have a name."""
        named = [body for body in frame.bodies if body.id in names]
        try:
            return {names[body.id]: z_up_pose(body, self._up) for body in named}
        except PoseError as error:
            raise DatagramError(
                f"frame {frame.number}: {error}", DropReason.IMPLAUSIBLE
            ) from error
