"""Poses of 6DOF bodies from Qualisys Track Manager."""

import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from threading import Event

from s2c2a.lab.tracking.datagrams import (
    DatagramError,
    DropReason,
    FrameOrder,
    named_poses,
)
from s2c2a.lab.tracking.hosts import LOCALHOST, check_port
from s2c2a.lab.tracking.poses import TrackingError
from s2c2a.lab.tracking.qualisys.packets import (
    PacketKind,
    PacketStream,
    body_pose,
    encode_command,
    parse_frame,
    parse_parameters,
    parse_text,
)
from s2c2a.lab.tracking.qualisys.session import QtmSession
from s2c2a.lab.tracking.receiving import MocapTracker
from s2c2a.lab.tracking.tracker import PoseFrame

DEFAULT_PORT = 22_223
START_TIMEOUT = 5.0  # [s]
CONNECT_TIMEOUT = 1.0  # [s]; of one attempt, for which `close` may wait
POLL_PERIOD = 0.05  # [s]; commands are late by no more, and `close` waits no longer
LONGEST_READ = 65_536  # bytes


class QualisysTracker(MocapTracker):
    """Receives the 6DOF bodies of QTM by its RT protocol over TCP, version 1.20.

    It connects again when QTM restarts. A body that QTM does not track is absent from
    the poses. The world frame has the z axis up. Every frame that is not valid,
    plausible and newer than all before is counted and dropped.
    """

    _dialog: QtmSession

    def __init__(
        self,
        host: str = LOCALHOST,
        port: int = DEFAULT_PORT,
        timeout: float = START_TIMEOUT,
    ):
        """A tracker that does not receive yet.

        Args:
            host: computer with QTM.
            port: of TCP, little-endian: the base port of QTM plus one.
            timeout: time that `start` waits for QTM [s].

        Raises:
            TrackingError: there is no such port.
        """
        check_port(port, "TCP")
        self._port = port
        super().__init__(host, timeout)

    def _reset(self) -> None:
        super()._reset()
        # users report of QTM that its frame number stays 1 in real time
        self._order = FrameOrder(by_time=True)
        self._dialog = QtmSession(f"{self._host}:{self._port}")

    @property
    def bodies(self) -> list[str]:
        """Names of the 6DOF bodies in QTM; empty before the connection."""
        parameters = self._dialog.parameters
        names = parameters.names if parameters is not None else ()
        return sorted(filter(None, names))

    def _packets(self, stop: Event) -> Iterator[tuple]:
        try:
            address = (self._server, self._port)
            with socket.create_connection(address, CONNECT_TIMEOUT) as connection:
                yield from self._converse(connection, stop)
        except OSError as error:
            raise TrackingError(f"the connection is lost: {error}") from error
        finally:
            self._dialog.lose()

    def _converse(self, connection: socket.socket, stop: Event) -> Iterator[tuple]:
        """Send the commands that are due, and yield what QTM sends."""
        packets = PacketStream()
        connection.settimeout(POLL_PERIOD)
        self._dialog.connect(time.perf_counter())
        while not stop.is_set():
            now = time.perf_counter()
            if self._dialog.is_lost(now):
                raise ConnectionError("QTM is silent")
            commands = self._dialog.due_commands(now)
            connection.sendall(b"".join(map(encode_command, commands)))
            with suppress(TimeoutError):
                data = connection.recv(LONGEST_READ)
                arrival = time.perf_counter()
                for packet in packets.feed(data):
                    yield packet.content, packet.kind, arrival
                if not data:
                    raise ConnectionError("QTM has closed it")

    def _handle(self, content: bytes, source: PacketKind, arrival: float) -> None:
        """Use a packet; its source is its kind."""
        session = self._dialog
        match source:
            case PacketKind.DATA:
                self._take_frame(content, arrival)
            case PacketKind.COMMAND:
                session.take_command(parse_text(content), arrival)
            case PacketKind.ERROR:
                session.take_error(parse_text(content), arrival)
            case PacketKind.XML:
                session.take_parameters(parse_parameters(content), arrival)
            case PacketKind.NO_MORE_DATA:
                session.take_no_data(arrival)
            case PacketKind.EVENT:
                session.take_event(int.from_bytes(content[:1]), arrival)
        if session.is_connected or session.is_refused:
            self._settled.set()

    def _take_frame(self, content: bytes, arrival: float) -> None:
        session = self._dialog
        if session.parameters is None:
            raise DatagramError("the bodies are not known yet", DropReason.EARLY)
        frame = parse_frame(content)
        names = session.parameters.names
        if session.is_outdated or len(frame.bodies) != len(names):
            session.request_parameters(arrival)
            raise DatagramError("the bodies may have changed", DropReason.EARLY)
        bodies = zip(names, frame.bodies, strict=True)
        seen = {name: body for name, body in bodies if name and body is not None}
        up = session.parameters.up
        poses = named_poses(seen, lambda body: body_pose(body, up))
        newest = PoseFrame(arrival, frame.time, frame.number, poses)
        if self._is_restart(newest):
            session.request_parameters(arrival)
            raise DatagramError("QTM has restarted", DropReason.EARLY)
        session.take_frame(arrival)
        self._keep(newest)
