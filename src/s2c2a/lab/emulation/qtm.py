"""Emulated Qualisys Track Manager: streams 6DOF bodies over TCP, with faults."""

import re
import socket
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from s2c2a.lab.emulation import qualisys_protocol as protocol
from s2c2a.lab.emulation.mocap_server import (
    MocapServer,
    StreamOptions,
    bound_socket,
    require,
)
from s2c2a.lab.emulation.qualisys_protocol import COMMAND, ERROR, VERSIONS
from s2c2a.lab.emulation.tracked_bodies import Bodies

DEFAULT_PORT = 22_223
_OLDEST = (1, 1)
_MAX_CLIENTS = 10
_LONGEST_READ = 4096  # bytes


@dataclass(frozen=True)
class QtmOptions(StreamOptions):
    """Options of an emulated QTM.

    Attributes:
        version: newest one of the protocol; one of `qualisys_protocol.VERSIONS`.
        port: of TCP.
        is_measuring: whether frames are available; QTM must run a measurement.
    """

    up: str = "z"
    version: str = "1.25"
    port: int = DEFAULT_PORT
    is_measuring: bool = True

    def __post_init__(self):
        super().__post_init__()
        require(self.version in VERSIONS, "version", self.version, ", ".join(VERSIONS))
        require(0 < self.port < 65_536, "port", self.port, "1 to 65535")


@dataclass(eq=False)
class _Client:
    """One connection.

    Attributes:
        socket: of the connection.
        version: that the client has chosen.
        buffer: received bytes that are no complete packet yet.
        unsent: bytes of a packet that did not fit into the socket.
        is_streaming: whether frames are sent.
    """

    socket: socket.socket
    version: str = "1.1"
    buffer: bytearray = field(default_factory=bytearray)
    unsent: bytes = b""
    is_streaming: bool = False


class Qtm(MocapServer[QtmOptions]):
    """Server of one stream by the QTM RT protocol, little-endian."""

    def __init__(self, names: Sequence[str], options: QtmOptions):
        """A server that is not open yet.

        Args:
            names: of the 6DOF bodies.
            options: of the stream.

        Raises:
            S2C2AError: a fault is invalid.
        """
        super().__init__(names, options)
        self._clients: list[_Client] = []

    @property
    def files(self) -> list[socket.socket]:
        return [*self._sockets, *(client.socket for client in self._clients)]

    @property
    def label(self) -> str:
        options = self.options
        return f"QTM, RT {options.version}: {options.host}, TCP {options.port}"

    def _open(self) -> list[socket.socket]:
        return [bound_socket(socket.SOCK_STREAM, self.options.host, self.options.port)]

    def _forget_clients(self) -> None:
        for client in self._clients:
            client.socket.close()
        self._clients.clear()

    def _answer_requests(self, now: float) -> None:
        with suppress(BlockingIOError):
            while True:
                self._welcome(self._sockets[0].accept()[0])
        for client in list(self._clients):
            self._read(client)

    def _welcome(self, accepted: socket.socket) -> None:
        accepted.setblocking(False)
        accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client = _Client(accepted)
        self._clients.append(client)
        if len(self._clients) > _MAX_CLIENTS:
            text = "Connection refused. Max number of clients reached."
            self._send(client, protocol.pack_text(ERROR, text))
            self._forget(client)
            return
        text = "QTM RT Interface connected"
        self._send(client, protocol.pack_text(COMMAND, text))

    def _read(self, client: _Client) -> None:
        try:
            data = client.socket.recv(_LONGEST_READ)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._forget(client)
            return
        client.buffer += data
        for command in protocol.take_commands(client.buffer):
            self._send(client, self._answer(client, command))

    def _answer(self, client: _Client, command: str) -> bytes:
        """Return the answer to a command; empty: none."""
        name, *arguments = command.lower().split() or [""]
        if name == "version":
            if not arguments:
                return protocol.pack_text(COMMAND, f"Version is {client.version}")
            wanted = arguments[0]
            is_valid = re.fullmatch(r"\d+\.\d+", wanted) is not None
            newest = _numbers(self.options.version)
            if not (is_valid and _OLDEST <= _numbers(wanted) <= newest):
                return protocol.pack_text(ERROR, "Version NOT supported")
            client.version = wanted
            return protocol.pack_text(COMMAND, f"Version set to {wanted}")
        if name == "qtmversion":
            return protocol.pack_text(COMMAND, "QTM Version is 2024.1 (emulated)")
        if name == "byteorder":
            return protocol.pack_text(COMMAND, "Byte order is little endian")
        if name == "getparameters":
            return self._parameters(client)
        if name == "streamframes":
            if arguments == ["stop"]:
                client.is_streaming = False
                return b""
            # Euler angles and other components are not emulated
            if len(arguments) != 2 or arguments[1] != "6d":
                return protocol.pack_text(ERROR, "Parse error")
            client.is_streaming = True
            is_measuring = self.options.is_measuring
            return b"" if is_measuring else protocol.pack(protocol.NO_MORE_DATA)
        return protocol.pack_text(ERROR, "Parse error")

    def _parameters(self, client: _Client) -> bytes:
        if not self._names:
            return protocol.pack_text(ERROR, "Parameters not available")
        return protocol.encode_parameters(client.version, self._names, self.options.up)

    def _encode(self, number: int, time: float, bodies: Bodies) -> bytes:
        return protocol.encode_frame(number, time, bodies.values())

    def _without_part(self, content: bytes) -> bytes:
        # the size is right, so that the next packet is found
        size = int(self._random.integers(8, len(content)))
        return protocol.pack(protocol.DATA, content[8:size])

    def _send_frame(self, content: bytes, now: float) -> None:
        if not self.options.is_measuring:
            return
        for client in list(self._clients):
            if client.is_streaming:
                self._send(client, content)

    def _send(self, client: _Client, content: bytes) -> None:
        """Send a packet; a client that does not read loses packets, never parts."""
        whole = not client.unsent
        data = client.unsent + (content if whole else b"")
        try:
            sent = client.socket.send(data)
        except BlockingIOError:
            sent = 0
        except OSError:
            self._forget(client)
            return
        client.unsent = data[sent:]

    def _forget(self, client: _Client) -> None:
        client.socket.close()
        if client in self._clients:
            self._clients.remove(client)


def _numbers(version: str) -> tuple[int, int]:
    major, minor = version.split(".")
    return int(major), int(minor)
