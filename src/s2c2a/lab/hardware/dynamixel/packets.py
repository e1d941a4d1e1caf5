"""Packets of the DYNAMIXEL protocol 2.0 (ROBOTIS e-manual, "Protocol 2.0").

| field       | bytes                                                          |
| ----------- | -------------------------------------------------------------- |
| header      | FF FF FD 00                                                    |
| id          | 1                                                              |
| length      | 2, little-endian: instruction, parameters and CRC              |
| instruction | 1                                                              |
| parameters  | any; in status packets, the first one is the error             |
| CRC         | 2, little-endian: CRC-16 of all bytes before, polynomial 8005  |

Where the bytes FF FF FD occur after the length, a byte FD is stuffed behind them, so
that they are not taken for a header.
"""

from collections.abc import Collection, Iterator

from s2c2a.lab.hardware.packets import BROADCAST, Answer, ServoPackets

HEADER = b"\xff\xff\xfd\x00"
PATTERN = b"\xff\xff\xfd"
STUFFED = b"\xff\xff\xfd\xfd"
PREFIX = 7  # bytes up to the length
MIN_LENGTH = 3  # instruction and CRC
MAX_LENGTH = 1024
CRC_POLYNOMIAL = 0x8005
REBOOT = 0x08
STATUS = 0x55
FAST_SYNC_READ = 0x8A


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        value = byte << 8
        for _ in range(8):
            carry = value & 0x8000
            value = (value << 1) & 0xFFFF
            value = value ^ CRC_POLYNOMIAL if carry else value
        table.append(value)
    return tuple(table)


_CRC = _crc_table()


def crc16(data: bytes) -> int:
    """Return the checksum of a packet, which begins at zero and is not reflected."""
    value = 0
    for byte in data:
        value = ((value << 8) & 0xFFFF) ^ _CRC[(value >> 8) ^ byte]
    return value


def encode(id: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return the bytes of an instruction packet.

    Args:
        id: of the servo, or `BROADCAST`.
        instruction: to carry out.
        parameters: without stuffing.
    """
    body = bytes([instruction]) + parameters
    body = body.replace(PATTERN, STUFFED)
    length = len(body) + 2
    packet = HEADER + bytes([id]) + length.to_bytes(2, "little") + body
    return packet + crc16(packet).to_bytes(2, "little")


def unstuffed(data: bytes) -> bytes:
    """Return data without the bytes that were stuffed in."""
    return data.replace(STUFFED, PATTERN)


class StatusReader:
    """Finds status packets in a stream of bytes; damaged ones are dropped.

    A joint answer may hold stuffing: the first servo states the length before it knows
    the data of the others, so firmware may not stuff it.

    Attributes:
        damaged: number of headers without a sound packet behind them.
    """

    def __init__(self, max_length: int = MAX_LENGTH):
        """A reader that has no bytes yet.

        Args:
            max_length: largest length field of an expected packet; a larger one is
                damaged, so that it does not swallow the packets behind it.
        """
        self._buffer = bytearray()
        self._max_length = max_length
        self.damaged = 0

    def feed(self, data: bytes) -> Iterator[Answer]:
        """Add bytes and yield the packets that are complete."""
        self._buffer += data
        while packet := self._next():
            yield packet

    def flush(self) -> Iterator[Answer]:
        """Yield the remaining packets at the end of the stream.

        An incomplete packet is dropped; complete ones inside it are found.
        """
        while self._buffer:
            self._drop_header()
            yield from self.feed(b"")

    def _next(self) -> Answer | None:
        """The next sound packet, or None if more bytes are needed."""
        while self._find_header():
            length = int.from_bytes(self._buffer[5:PREFIX], "little")
            if not MIN_LENGTH + 1 <= length <= self._max_length:
                self._drop_header()
                continue
            end = PREFIX + length
            if len(self._buffer) < end:
                return None
            packet = self._decode(bytes(self._buffer[:end]))
            if packet is None:
                self._drop_header()
                continue
            del self._buffer[:end]
            return packet
        return None

    def _find_header(self) -> bool:
        """Drop bytes before a header; return whether the length is known."""
        start = self._buffer.find(HEADER)
        if start < 0:
            # the end may be the beginning of a header
            del self._buffer[: max(len(self._buffer) - len(HEADER) + 1, 0)]
            return False
        del self._buffer[:start]
        return len(self._buffer) >= PREFIX

    def _drop_header(self) -> None:
        self.damaged += self._buffer.startswith(HEADER)
        del self._buffer[0]

    def _decode(self, packet: bytes) -> Answer | None:
        """The content of a whole packet; None if it is damaged or no status."""
        content = packet[:-2]
        if crc16(content) != int.from_bytes(packet[-2:], "little"):
            return None
        if packet[PREFIX] != STATUS:
            return None
        id = packet[4]
        body = content[PREFIX:]
        if id != BROADCAST:
            body = unstuffed(body)
        return Answer(id, body[1], body[2:])


class DynamixelPackets(ServoPackets):
    """Packets of protocol 2.0."""

    word = 2
    overhead = 11

    def encode(self, id: int, instruction: int, parameters: bytes = b"") -> bytes:
        return encode(id, instruction, parameters)

    def reader(self, ids: Collection[int], size: int) -> StatusReader:
        """See `ServoPackets`; it finds the answers of all servos."""
        return StatusReader()
