"""Packets of the Feetech protocol, and the encoding of values. Pure functions.

An instruction is `FF FF id length instruction parameters checksum`, an answer is
`FF FF id length error data checksum`. The length counts everything after itself, the
checksum is the inverted sum of everything after the header.
"""

from collections.abc import Collection

from s2c2a.lab.hardware.bus import BusError
from s2c2a.lab.hardware.packets import Answer, ServoPackets

HEADER = b"\xff\xff"
MAX_LENGTH = 250
OVERHEAD = 6
"""Bytes of an answer besides its data."""


def encode_packet(id: int, instruction: int, parameters: bytes) -> bytes:
    """Encode an instruction.

    Raises:
        BusError: it is too long.
    """
    length = len(parameters) + 2
    if length > MAX_LENGTH:
        raise BusError(
            f"the instruction has {length} bytes; the protocol allows {MAX_LENGTH}: "
            "use fewer servos on this port"
        )
    body = bytes((id, length, instruction)) + parameters
    return HEADER + body + bytes((checksum(body),))


def checksum(body: bytes) -> int:
    """Return the checksum of everything between header and checksum."""
    return ~sum(body) & 0xFF


def take_answers(buffer: bytearray, ids: Collection[int], size: int) -> list[Answer]:
    """Remove all complete answers from a buffer, and everything before them.

    Bytes that are no valid answer of an expected servo are skipped one by one, so that
    noise, an echo of the instruction or a damaged answer never costs the next answer.

    Args:
        buffer: received bytes; what may become an answer stays in it.
        ids: of the servos that are expected.
        size: of the data in an answer [bytes].
    """
    answers = []
    total = size + OVERHEAD
    while len(buffer) >= total:
        answer = _answer_at_start(buffer, ids, size)
        if answer is not None:
            answers.append(answer)
            del buffer[:total]
        else:
            del buffer[: _next_start(buffer)]
    return answers


def _answer_at_start(
    buffer: bytearray, ids: Collection[int], size: int
) -> Answer | None:
    total = size + OVERHEAD
    body = bytes(buffer[2 : total - 1])
    (id, length, error) = body[:3]
    fits = buffer[:2] == HEADER and id in ids and length == size + 2
    if not fits or buffer[total - 1] != checksum(body):
        return None
    return Answer(id, error, body[3:])


def _next_start(buffer: bytearray) -> int:
    """Number of bytes before the next one that may begin an answer."""
    start = buffer.find(HEADER[:1], 1)
    return len(buffer) if start < 0 else start


class FeetechReader:
    """Finds the answers of expected servos in a stream of bytes."""

    def __init__(self, ids: Collection[int], size: int):
        """A reader that has no bytes yet.

        Args:
            ids: of the servos that are expected.
            size: of the data in an answer [bytes].
        """
        self._ids = ids
        self._size = size
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Answer]:
        """Add bytes and return the answers that are complete."""
        self._buffer += data
        return take_answers(self._buffer, self._ids, self._size)

    def flush(self) -> list[Answer]:
        """Return nothing: no answer hides in an incomplete one."""
        return []


class FeetechPackets(ServoPackets):
    """Packets of the Feetech protocol."""

    word = 1
    overhead = OVERHEAD

    def encode(self, id: int, instruction: int, parameters: bytes = b"") -> bytes:
        return encode_packet(id, instruction, parameters)

    def reader(self, ids: Collection[int], size: int) -> FeetechReader:
        return FeetechReader(ids, size)
