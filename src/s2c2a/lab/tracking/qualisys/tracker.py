"""Poses of 6DOF bodies from Qualisys Track Manager."""

import select
import socket
import time
from threading import Event, Thread

from s2c2a.lab.tracking.datagrams import Datagram, DatagramError, DropReason, FrameOrder
from s2c2a.lab.tracking.hosts import resolve
from s2c2a.lab.tracking.poses import Pose, PoseError, TrackingError
from s2c2a.lab.tracking.qualisys.packets import (
    Frame,
    Packet,
    PacketKind,
    PacketStream,
    Parameters,
    body_pose,
    encode_command,
    parse_frame,
    parse_parameters,
    parse_text,
)
from s2c2a.lab.tracking.qualisys.session import Session
from s2c2a.lab.tracking.tracker import PoseFrame, Tracker
from s2c2a.lab.tracking.udp import LOCALHOST, MAX_PORT, DatagramCounts

DEFAULT_PORT = 22_223
START_TIMEOUT = 5.0  # [s]
CONNECT_TIMEOUT = 3.0  # [s]; of one attempt
FIRST_PAUSE = 0.1  # [s]; between two attempts, doubles every time
LONGEST_PAUSE = 3.0  # [s]
POLL_PERIOD = 0.05  # [s]; commands are late by no more, and `close` waits no longer
LONGEST_READ = 65_536  # bytes


class QualisysTracker(Tracker):
    """Receives the 6DOF bodies of QTM by its RT protocol over TCP, version 1.20.

    A thread connects, receives, and connects again when QTM restarts. A body that QTM
    does not track is absent from the poses. The world frame has the z axis up. Every
    frame that is not valid, plausible and newer than all before is counted and dropped.
    """

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
        if not 0 < port <= MAX_PORT:
            raise TrackingError(f"TCP port {port}; choose 1 to {MAX_PORT}")
        self._host = host
        self._port = port
        self._timeout = timeout
        self._thread: Thread | None = None
        self._stop = Event()
        self._reset()

    def _reset(self) -> None:
        self._latest: PoseFrame | None = None
        self._session = Session(f"{self._host}:{self._port}")
        self._settled = Event()
        self._order = FrameOrder()
        self._accepted = 0
        self._dropped = dict.fromkeys(DropReason, 0)
        self._pause = FIRST_PAUSE

    @property
    def counts(self) -> DatagramCounts:
        """Numbers of accepted frames and of dropped packets."""
        dropped = self._dropped.copy()
        return DatagramCounts(self._accepted, dropped, self._order.restarts)

    @property
    def problem(self) -> str:
        """Why no frames arrive; empty while they do."""
        return self._session.problem

    @property
    def bodies(self) -> list[str]:
        """Names of the 6DOF bodies in QTM; empty before the connection."""
        parameters = self._session.parameters
        names = parameters.names if parameters is not None else ()
        return sorted(filter(None, names))

    def start(self) -> None:
        """See `Tracker`.

        Raises:
            TrackingError: QTM does not answer, is too old, or has no 6DOF bodies.
        """
        if self._thread is not None:
            return
        self._server = resolve(self._host)
        self._stop = Event()
        self._reset()
        self._thread = Thread(
            target=self._receive,
            args=(self._stop,),
            name="qualisys-receiver",
            daemon=True,
        )
        self._thread.start()
        self._settled.wait(self._timeout)
        if not self._session.is_connected:
            problem = self.problem
            self.close()
            raise TrackingError(problem)

    def latest(self) -> PoseFrame | None:
        """See `Tracker`."""
        return self._latest

    def close(self) -> None:
        """See `Tracker`."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        self._thread = None

    def _receive(self, stop: Event) -> None:
        while not stop.is_set():
            # the thread outlives every failure: a dead one looks like a lost source
            try:
                self._serve_connection(stop)
            except DatagramError as error:
                self._dropped[error.reason] += 1
            except OSError:
                # `problem` states what is known
                pass
            except Exception:
                self._dropped[DropReason.FAILED] += 1
            self._session.lose()
            stop.wait(self._pause)
            self._pause = min(2 * self._pause, LONGEST_PAUSE)

    def _serve_connection(self, stop: Event) -> None:
        """Connect and receive until the connection is lost or the tracker stops."""
        packets = PacketStream()
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as connection:
            self._connect(connection, stop)
            self._session.connect(time.perf_counter())
            while not stop.is_set():
                self._send_commands(connection)
                ready, _, _ = select.select([connection], [], [], POLL_PERIOD)
                if ready:
                    self._read(connection, packets)

    def _connect(self, connection: socket.socket, stop: Event) -> None:
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.connect_ex((self._server, self._port))
        end = time.perf_counter() + CONNECT_TIMEOUT
        while not stop.is_set() and time.perf_counter() < end:
            _, ready, _ = select.select([], [connection], [], POLL_PERIOD)
            if ready:
                break
        # raises the error of the attempt
        connection.getpeername()

    def _send_commands(self, connection: socket.socket) -> None:
        now = time.perf_counter()
        if self._session.is_lost(now):
            raise ConnectionError("QTM is silent")
        for command in self._session.due_commands(now):
            connection.sendall(encode_command(command))

    def _read(self, connection: socket.socket, packets: PacketStream) -> None:
        data = connection.recv(LONGEST_READ)
        if not data:
            raise ConnectionError("QTM has closed the connection")
        arrival = time.perf_counter()
        for packet in packets.feed(data):
            try:
                self._take(packet, arrival)
            except DatagramError as error:
                self._dropped[error.reason] += 1

    def _take(self, packet: Packet, arrival: float) -> None:
        """Use a packet, or raise `DatagramError`."""
        session = self._session
        match packet.kind:
            case PacketKind.DATA:
                self._take_frame(packet.content, arrival)
            case PacketKind.COMMAND:
                session.take_command(parse_text(packet.content), arrival)
            case PacketKind.ERROR:
                session.take_error(parse_text(packet.content), arrival)
            case PacketKind.XML:
                session.take_parameters(parse_parameters(packet.content), arrival)
            case PacketKind.NO_MORE_DATA:
                session.take_no_data(arrival)
            case PacketKind.EVENT:
                session.take_event(int.from_bytes(packet.content[:1]), arrival)
        if session.is_connected or session.is_refused:
            self._settled.set()

    def _take_frame(self, content: bytes, arrival: float) -> None:
        session = self._session
        if session.parameters is None:
            raise DatagramError("the bodies are not known yet", DropReason.EARLY)
        frame = parse_frame(content)
        names = session.parameters.names
        if session.is_outdated or len(frame.bodies) != len(names):
            session.request_parameters(arrival)
            raise DatagramError("the bodies may have changed", DropReason.EARLY)
        poses = _named_poses(frame, session.parameters)
        self._accept(Datagram(frame.time, frame.number, poses), arrival)

    def _accept(self, datagram: Datagram, arrival: float) -> None:
        """Make a frame the newest one, unless QTM has restarted."""
        restarts = self._order.restarts
        self._order.accept(datagram, arrival)
        if self._order.restarts > restarts:
            self._session.request_parameters(arrival)
            raise DatagramError("QTM has restarted", DropReason.EARLY)
        self._session.take_frame(arrival)
        self._pause = FIRST_PAUSE
        self._latest = PoseFrame(arrival, datagram.time, datagram.frame, datagram.poses)
        self._accepted += 1


def _named_poses(frame: Frame, parameters: Parameters) -> dict[str, Pose]:
    """Return the poses of the tracked bodies that have a name."""
    pairs = zip(parameters.names, frame.bodies, strict=True)
    seen = {name: body for name, body in pairs if name and body is not None}
    try:
        return {name: body_pose(body, parameters.up) for name, body in seen.items()}
    except PoseError as error:
        raise DatagramError(
            f"frame {frame.number}: {error}", DropReason.IMPLAUSIBLE
        ) from error
