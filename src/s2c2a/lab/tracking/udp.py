"""Poses as JSON datagrams over UDP, from any process of this or another computer."""

import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from threading import Event

from s2c2a.lab.tracking.datagrams import MAX_BYTES, parse_datagram
from s2c2a.lab.tracking.hosts import LOCALHOST, check_port
from s2c2a.lab.tracking.poses import TrackingError
from s2c2a.lab.tracking.receiving import ReceivingTracker

DEFAULT_PORT = 9763
POLL_PERIOD = 0.1  # [s]; `close` waits no longer


class UdpTracker(ReceivingTracker):
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
        check_port(port, "UDP", lowest=0)
        self._host = host
        self._port = port
        self._socket: socket.socket | None = None
        super().__init__()

    @property
    def address(self) -> tuple[str, int]:
        """Address and port that receive datagrams.

        Raises:
            TrackingError: the tracker has not started.
        """
        host, port = self._listening.getsockname()
        return host, port

    @property
    def _listening(self) -> socket.socket:
        if self._socket is None:
            raise TrackingError("the tracker does not listen; call start() first")
        return self._socket

    @property
    def problem(self) -> str:
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

    def _open(self) -> None:
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
        self._socket = receiver

    def _release(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def _packets(self, stop: Event) -> Iterator[tuple]:
        receiver = self._listening
        while not stop.is_set():
            with suppress(TimeoutError):
                content, sender = receiver.recvfrom(MAX_BYTES + 1)
                yield content, sender, time.perf_counter()

    def _handle(self, content: bytes, source: object, arrival: float) -> None:
        frame = parse_datagram(content, arrival)
        self._is_restart(frame, source)
        self._keep(frame)
