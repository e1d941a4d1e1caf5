"""Poses as JSON datagrams over UDP, from any process of this or another computer."""

import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from threading import Event, Thread

from s2c2a.lab.tracking.datagrams import (
    MAX_BYTES,
    DatagramError,
    DropReason,
    FrameOrder,
    parse_datagram,
)
from s2c2a.lab.tracking.poses import TrackingError
from s2c2a.lab.tracking.tracker import PoseFrame, Tracker

LOCALHOST = "127.0.0.1"
DEFAULT_PORT = 9763
MAX_PORT = 65_535
POLL_PERIOD = 0.1  # [s]; `close` waits no longer
ERROR_PAUSE = 0.01  # [s]; a socket that fails at once must not take a whole core


@dataclass(frozen=True)
class DatagramCounts:
    """Numbers of datagrams since the tracker started.

    Attributes:
        accepted: that became frames.
        dropped: by reason; every reason is present.
        restarts: of the sender.
    """

    accepted: int
    dropped: Mapping[DropReason, int]
    restarts: int


class UdpTracker(Tracker):
    """Receives poses as JSON datagrams; `docs/guides/tracking.md` states the format.

    Every datagram that is not valid, plausible and newer than all before is counted
    and dropped.
    """

    def __init__(self, host: str = LOCALHOST, port: int = DEFAULT_PORT):
        """A tracker that does not receive yet.

        Args:
            host: IPv4 address or name of the interface that listens; "0.0.0.0" for
                all. Only this computer reaches the default.
            port: of UDP; 0 takes a free one.

        Raises:
            TrackingError: there is no such port.
        """
        if not 0 <= port <= MAX_PORT:
            raise TrackingError(f"UDP port {port}; choose 0 to {MAX_PORT}")
        self._host = host
        self._port = port
        self._socket: socket.socket | None = None
        self._thread: Thread | None = None
        self._stop = Event()
        self._reset()

    def _reset(self) -> None:
        self._latest: PoseFrame | None = None
        self._order = FrameOrder()
        self._accepted = 0
        self._dropped = dict.fromkeys(DropReason, 0)
        self._fault = ""

    @property
    def address(self) -> tuple[str, int]:
        """Address and port that receive datagrams.

        Raises:
            TrackingError: the tracker has not started.
        """
        if self._socket is None:
            raise TrackingError("the tracker does not listen; call start() first")
        host, port = self._socket.getsockname()
        return host, port

    @property
    def problem(self) -> str:
        """See `Tracker`."""
        if self._accepted or self._socket is None:
            return ""
        host, port = self.address
        dropped = {
            reason.name: count for reason, count in self._dropped.items() if count
        }
        if not dropped:
            return f"nothing arrives on {host}:{port}"
        counts = ", ".join(f"{count} {name}" for name, count in dropped.items())
        return f"all datagrams on {host}:{port} are dropped ({counts}): {self._fault}"

    @property
    def counts(self) -> DatagramCounts:
        """Numbers of accepted and dropped datagrams."""
        dropped = self._dropped.copy()
        return DatagramCounts(self._accepted, dropped, self._order.restarts)

    def start(self) -> None:
        """See `Tracker`.

        Raises:
            TrackingError: the port is taken, or the address is not of this computer.
        """
        if self._socket is not None:
            return
        self._socket = self._bound_socket()
        self._reset()
        self._stop = Event()
        self._thread = Thread(
            target=self._receive,
            args=(self._socket, self._stop),
            name="pose-receiver",
            daemon=True,
        )
        self._thread.start()

    def latest(self) -> PoseFrame | None:
        """See `Tracker`."""
        return self._latest

    def close(self) -> None:
        """See `Tracker`."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        if self._socket is not None:
            self._socket.close()
        self._thread = None
        self._socket = None

    def _bound_socket(self) -> socket.socket:
        receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            receiver.bind((self._host, self._port))
        # TypeError, ValueError: a name that cannot be a host
        except (OSError, TypeError, ValueError) as error:
            receiver.close()
            raise TrackingError(
                f"cannot listen on UDP {self._host!a}:{self._port}: {error}; "
                "close the program that listens there, or choose another port"
            ) from error
        receiver.settimeout(POLL_PERIOD)
        return receiver

    def _receive(self, receiver: socket.socket, stop: Event) -> None:
        while not stop.is_set():
            with suppress(TimeoutError):
                self._receive_one(receiver, stop)

    def _receive_one(self, receiver: socket.socket, stop: Event) -> None:
        try:
            content, sender = receiver.recvfrom(MAX_BYTES + 1)
            self._handle(content, sender, time.perf_counter())
        except TimeoutError:
            raise
        except DatagramError as error:
            self._dropped[error.reason] += 1
            self._fault = str(error)
        # the thread outlives every failure: a dead one looks like a lost source
        except Exception:
            self._dropped[DropReason.FAILED] += 1
            stop.wait(ERROR_PAUSE)

    def _handle(self, content: bytes, sender: object, arrival: float) -> None:
        """Make a datagram the latest frame, or raise `DatagramError`."""
        datagram = parse_datagram(content)
        self._order.accept(datagram, arrival, sender)
        self._latest = PoseFrame(arrival, datagram.time, datagram.frame, datagram.poses)
        self._accepted += 1
