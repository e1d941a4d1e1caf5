"""Packets in a stream of bytes, whatever their protocol."""

from abc import ABC, abstractmethod
from typing import Generic, TypeVar

Packet = TypeVar("Packet")
STALE = 0.1  # s; the rest of a packet does not come later than this


class StreamDecoder(ABC, Generic[Packet]):
    """Finds packets in bytes that come in pieces.

    A subclass knows the form of a packet.
    """

    def __init__(self):
        self._buffer = bytearray()
        self._fed = 0.0

    def feed(self, data: bytes, now: float) -> list[Packet]:
        """Return the packets that bytes complete.

        Args:
            data: bytes as they come.
            now: time [s].
        """
        if now - self._fed > STALE:
            self._buffer.clear()
        self._fed = now
        self._buffer += data
        packets = []
        while (packet := self._take()) is not None:
            packets.append(packet)
        return packets

    @abstractmethod
    def _take(self) -> Packet | None:
        """Remove the first complete packet from the buffer; None if there is none."""
