"""Poses of rigid bodies from OptiTrack Motive."""

import os
import select
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from threading import Event

from s2c2a.lab.tracking.datagrams import DatagramError, DropReason, named_poses
from s2c2a.lab.tracking.hosts import LOCALHOST, check_port
from s2c2a.lab.tracking.natnet.connection import Connection
from s2c2a.lab.tracking.natnet.messages import (
    MAX_MESSAGE,
    MessageKind,
    Reader,
    encode_request,
    parse_definitions,
    parse_frame,
    parse_server_info,
    split_message,
)
from s2c2a.lab.tracking.poses import UP_AXES, TrackingError, turn_up
from s2c2a.lab.tracking.receiving import MocapTracker
from s2c2a.lab.tracking.tracker import PoseFrame

COMMAND_PORT = 1510
DATA_PORT = 1511
CONNECT_TIMEOUT = 5.0  # [s]
RECEIVE_BUFFER = 1 << 20  # bytes; frames wait here while the computer is busy
POLL_PERIOD = 0.05  # [s]; requests are late by no more, and `close` waits no longer


class NatNetTracker(MocapTracker):
    """Receives the rigid bodies of Motive by NatNet 3.1, 4.0, 4.1 or 4.2.

    It connects again when Motive restarts. A body that Motive does not track is absent
    from the poses. The world frame has the z axis up. Every frame that is not valid,
    plausible and newer than all before is counted and dropped.
    """

    _dialog: Connection

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
            check_port(port, "UDP")
        if up not in UP_AXES:
            raise TrackingError(
                f"up axis '{up}'; give y or z, as in Motive's streaming settings"
            )
        self._local = local
        self._multicast = multicast
        self._command_port = command_port
        self._data_port = data_port
        self._up = up
        self._sockets: list[socket.socket] = []
        super().__init__(host, timeout)

    def _reset(self) -> None:
        super()._reset()
        self._dialog = Connection(f"{self._host}:{self._command_port}")

    @property
    def bodies(self) -> list[str]:
        """Names of the rigid bodies in Motive; empty before the connection."""
        return sorted((self._dialog.names or {}).values())

    def _open(self) -> None:
        super()._open()
        self._sockets = [_open_socket(self._local)]
        if self._multicast is not None:
            self._join(self._multicast, self._data_port)

    def _release(self) -> None:
        for opened in self._sockets:
            opened.close()
        self._sockets = []

    def _join(self, group: str, port: int) -> None:
        self._sockets.append(_open_socket(self._local, group, port))

    def _packets(self, stop: Event) -> Iterator[tuple]:
        while not stop.is_set():
            self._send_request(time.perf_counter())
            ready, _, _ = select.select(self._sockets, [], [], POLL_PERIOD)
            for receiver in ready:
                # Windows reports a port without a listener here
                with suppress(ConnectionError):
                    content, (sender, _) = receiver.recvfrom(MAX_MESSAGE)
                    yield content, sender, time.perf_counter()

    def _send_request(self, now: float) -> None:
        kind = self._dialog.due_request(now)
        if kind is None:
            return
        address = (self._server, self._command_port)
        # the network may come back; until then `problem` states that there is no answer
        with suppress(OSError):
            self._sockets[0].sendto(encode_request(kind), address)

    def _handle(self, content: bytes, source: str, arrival: float) -> None:
        if source != self._server:
            raise DatagramError(
                f"{source} is not the computer with Motive", DropReason.OTHER_SENDER
            )
        kind, reader = split_message(content)
        if kind == MessageKind.FRAME:
            self._take_frame(reader, arrival)
        elif kind == MessageKind.SERVER_INFO:
            info = parse_server_info(reader)
            self._dialog.take_server_info(info, arrival)
            if self._dialog.layout is None:
                self._settled.set()
            elif info.group is not None and len(self._sockets) == 1:
                self._join_stated(info.group)
        elif kind == MessageKind.DEFINITIONS:
            layout = self._dialog.layout
            if layout is not None:
                names = parse_definitions(reader, layout)
                self._dialog.take_definitions(names, arrival)
                self._settled.set()

    def _join_stated(self, group: tuple[str, int]) -> None:
        """Join the group that Motive states."""
        try:
            self._join(*group)
        except TrackingError as error:
            self._dialog.problem = str(error)

    def _take_frame(self, reader: Reader, arrival: float) -> None:
        dialog = self._dialog
        if dialog.layout is None or dialog.names is None:
            dialog.request_soon(arrival)
            raise DatagramError("the version is not known yet", DropReason.EARLY)
        frame = parse_frame(reader, dialog.layout)
        names = dialog.names
        known = {names[one.id]: one for one in frame.bodies if one.id in names}
        poses = named_poses(
            known, lambda body: turn_up(body.position, body.rotation, self._up)
        )
        newest = PoseFrame(arrival, frame.time, frame.number, poses)
        restarted = self._is_restart(newest)
        is_unknown = len(known) < len(frame.bodies)
        if frame.models_changed or restarted or is_unknown:
            dialog.request_definitions(arrival)
        dialog.take_frame(arrival)
        self._keep(newest)


def _open_socket(local: str, group: str = "", port: int = 0) -> socket.socket:
    """Return a socket for requests, their answers and unicast frames; or for multicast.

    Several programs may listen to a group.

    Args:
        local: address of this computer in the network of Motive.
        group: multicast address; empty: unicast.
        port: of the frames of a group.

    Raises:
        TrackingError: the address is not of this computer, or the group cannot be
            joined.
    """
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        if group:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            # bound to the group, the socket gets no frames of other groups; Windows refuses it
            opened.bind((local if os.name == "nt" else group, port))
            membership = socket.inet_aton(group) + socket.inet_aton(local)
            opened.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        else:
            opened.bind((local, port))
    except (OSError, ValueError, TypeError) as error:
        opened.close()
        place = f"the group {group!a}:{port} on " if group else ""
        raise TrackingError(
            f"cannot listen to {place}{local!a}: {error}; give the address of this "
            "computer in the network of Motive"
        ) from error
    opened.setblocking(False)
    return opened
