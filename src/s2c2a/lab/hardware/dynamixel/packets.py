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

from collections.abc import Collection

from s2c2a.lab.hardware.packets import BROADCAST, Answer, AnswerReader, ServoPackets

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


def unstuffed(data: bytes) -> bytes:
    """Return data without the bytes that were stuffed in."""
    return data.replace(STUFFED, PATTERN)


def decode(packet: bytes) -> Answer | None:
    """Return the content of a whole packet; None if it is damaged or no status.

    A joint answer may hold stuffing: the first servo states the length before it knows
    the data of the others, so firmware may not stuff it.
    """
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
        """See `ServoPackets`; the parameters are without stuffing."""
        body = bytes([instruction]) + parameters
        body = body.replace(PATTERN, STUFFED)
        length = len(body) + 2
        packet = HEADER + bytes([id]) + length.to_bytes(2, "little") + body
        return packet + crc16(packet).to_bytes(2, "little")

    def reader(
        self, ids: Collection[int] = (), size: int = 0, max_length: int = MAX_LENGTH
    ) -> AnswerReader:
        """Return a reader of the answers of all servos.

        Args:
            ids: see `ServoPackets`.
            size: see `ServoPackets`.
            max_length: largest length field of an expected packet; a larger one is
                damaged, so that it does not swallow the packets behind it.
        """

        def size_of(start: bytearray) -> int:
            length = int.from_bytes(start[5:PREFIX], "little")
            return PREFIX + length if MIN_LENGTH < length <= max_length else 0

        return AnswerReader(HEADER, PREFIX, size_of, decode)
