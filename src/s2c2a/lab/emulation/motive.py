"""Emulated OptiTrack Motive: streams rigid bodies by NatNet, with faults."""

import socket
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from s2c2a.lab.emulation import natnet_protocol as protocol
from s2c2a.lab.emulation.mocap_server import (
    MocapServer,
    StreamOptions,
    bound_socket,
    require,
)
from s2c2a.lab.emulation.natnet_protocol import VERSIONS
from s2c2a.lab.emulation.tracked_bodies import Bodies

_CLIENT_TIMEOUT = 10.0  # s; a client that does not keep itself alive is forgotten
_MAX_CLIENTS = 16
_LONGEST_REQUEST = 2048  # bytes


@dataclass(frozen=True)
class MotiveOptions(StreamOptions):
    """Options of an emulated Motive.

    Attributes:
        version: of NatNet; one of `natnet_protocol.VERSIONS`.
        command_port: for requests.
        data_port: of the frames, for multicast.
        multicast: group of the frames; empty: unicast to clients that connect.
    """

    version: str = "4.1"
    command_port: int = 1510
    data_port: int = 1511
    multicast: str = ""

    def __post_init__(self):
        super().__post_init__()
        require(self.version in VERSIONS, "version", self.version, ", ".join(VERSIONS))
        for name in ("command_port", "data_port"):
            port = getattr(self, name)
            require(0 < port < 65_536, name, port, "1 to 65535")
        require(
            not self.multicast or _is_group(self.multicast),
            "multicast",
            self.multicast,
            "a group such as 239.255.42.99",
        )


def _is_group(text: str) -> bool:
    try:
        return 224 <= socket.inet_aton(text)[0] < 240 and text.count(".") == 3
    except OSError:
        return False


class Motive(MocapServer[MotiveOptions]):
    """Server of one stream by NatNet."""

    def __init__(self, names: Sequence[str], options: MotiveOptions):
        """A server that is not open yet.

        Args:
            names: of the rigid bodies, whose ids count from 1.
            options: of the stream.

        Raises:
            S2C2AError: a fault is invalid.
        """
        super().__init__(names, options)
        self._clients: dict[tuple[str, int], float] = {}

    @property
    def label(self) -> str:
        options = self.options
        ports = f"UDP {options.command_port} and {options.data_port}"
        return f"Motive, NatNet {options.version}: {options.host}, {ports}"

    def _open(self) -> list[socket.socket]:
        host = self.options.host
        commands = bound_socket(socket.SOCK_DGRAM, host, self.options.command_port)
        data = bound_socket(socket.SOCK_DGRAM, host, 0)
        interface = socket.inet_aton(socket.gethostbyname(host))
        data.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
        return [commands, data]

    def _forget_clients(self) -> None:
        self._clients.clear()

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

    def _encode(self, number: int, time: float, bodies: Bodies) -> bytes:
        options = self.options
        return protocol.encode_frame(
            options.version, number, time, bodies, options.latency
        )

    def _without_part(self, content: bytes) -> bytes:
        return content[: self._random.integers(len(content))]

    def _send_frame(self, content: bytes, now: float) -> None:
        data = self._sockets[1]
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
