"""Packets of the Feetech protocol, and the encoding of values. Pure functions.

An instruction is `FF FF id length instruction parameters checksum`, an answer is
`FF FF id length error data checksum`. The length counts everything after itself, the
checksum is the inverted sum of everything after the header.
"""

from collections.abc import Collection

from s2c2a.lab.hardware.bus import BusError
from s2c2a.lab.hardware.packets import Answer, AnswerReader, ServoPackets

HEADER = b"\xff\xff"
MAX_LENGTH = 250
PREFIX = 4  # bytes up to the length


def checksum(body: bytes) -> int:
    """Return the checksum of everything between header and checksum."""
    return ~sum(body) & 0xFF


def decode(packet: bytes) -> Answer | None:
    """Return the content of an answer; None if it is damaged."""
    body = packet[2:-1]
    if packet[-1] != checksum(body):
        return None
    return Answer(body[0], body[2], body[3:])


class FeetechPackets(ServoPackets):
    """Packets of the Feetech protocol."""

    word = 1
    overhead = 6

    def encode(self, id: int, instruction: int, parameters: bytes = b"") -> bytes:
        """See `ServoPackets`.

        Raises:
            BusError: it is too long.
        """
        length = len(parameters) + 2
        if length > MAX_LENGTH:
            raise BusError(
                f"the instruction has {length} bytes; the protocol allows "
                f"{MAX_LENGTH}: use fewer servos on this port"
            )
        body = bytes((id, length, instruction)) + parameters
        return HEADER + body + bytes((checksum(body),))

    def reader(self, ids: Collection[int], size: int) -> AnswerReader:
        """See `ServoPackets`; only answers of these servos and this size count."""

        def size_of(start: bytearray) -> int:
            fits = start[2] in ids and start[3] == size + 2
            return size + self.overhead if fits else 0

        return AnswerReader(HEADER, PREFIX, size_of, decode)
