"""Poses as JSON datagrams over UDP, with faults."""

import json
import socket
from contextlib import suppress
from dataclasses import dataclass

from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.mocap_server import MocapServer, StreamOptions, require
from s2c2a.lab.emulation.tracked_bodies import Bodies, StreamedBody

DEFAULT_PORT = 9763


@dataclass(frozen=True)
class DatagramOptions(StreamOptions):
    """Options of a sender of JSON datagrams.

    Attributes:
        receiver: host and port.
    """

    up: str = "z"
    receiver: tuple[str, int] = ("127.0.0.1", DEFAULT_PORT)

    def __post_init__(self):
        super().__post_init__()
        require(0 < self.receiver[1] < 65_536, "port", self.receiver[1], "1 to 65535")


def encode_poses(number: int, time: float, bodies: Bodies) -> bytes:
    """Return a datagram.

    Args:
        number: of the frame.
        time: on the clock of the sender [s].
        bodies: by name.
    """
    content = {
        "time": time,
        "frame": number,
        "bodies": {name: _describe(body) for name, body in bodies.items()},
    }
    return json.dumps(content).encode()


def _describe(body: StreamedBody) -> dict[str, list[float]] | None:
    if not body.is_tracked:
        return None
    return {
        "position": body.pose.position.tolist(),
        "rotation": body.pose.rotation.tolist(),
    }


class PoseDatagrams(MocapServer[DatagramOptions]):
    """Sender of one stream of JSON datagrams to one receiver, without connections."""

    @property
    def files(self) -> list[socket.socket]:
        return []

    @property
    def label(self) -> str:
        host, port = self.options.receiver
        return f"JSON datagrams to {host}, UDP {port}"

    def _open(self) -> list[socket.socket]:
        sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sender.setblocking(False)
        return [sender]

    def _encode(self, number: int, time: float, bodies: Bodies) -> bytes:
        return encode_poses(number, time, bodies)

    def _without_part(self, content: bytes) -> bytes:
        """Return a datagram without a key of the frame or of a body."""
        value = json.loads(content)
        places = [value, *(body for body in value["bodies"].values() if body)]
        place = places[self._random.integers(len(places))]
        del place[list(place)[self._random.integers(len(place))]]
        return json.dumps(value).encode()

    def _send_frame(self, content: bytes, now: float) -> None:
        try:
            # a receiver that is absent is no error
            with suppress(ConnectionError, BlockingIOError):
                self._sockets[0].sendto(content, self.options.receiver)
        except OSError as error:
            raise S2C2AError(
                f"cannot send to {self.options.receiver}: {error}; correct --poses-to"
            ) from error
