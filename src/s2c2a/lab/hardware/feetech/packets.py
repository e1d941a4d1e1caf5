"""Packets of the Feetech protocol, and the encoding of values. Pure functions.

An instruction is `FF FF id length instruction parameters checksum`, an answer is
`FF FF id length error data checksum`. The length counts everything after itself, the
checksum is the inverted sum of everything after the header.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import index

from s2c2a.lab.hardware.bus import BusError
from s2c2a.lab.hardware.feetech.tables import Register

HEADER = b"\xff\xff"
BROADCAST = 0xFE
READ = 0x02
WRITE = 0x03
SYNC_READ = 0x82
SYNC_WRITE = 0x83
MAX_LENGTH = 250
OVERHEAD = 6
"""Bytes of an answer besides its data."""


@dataclass(frozen=True)
class Answer:
    """Answer of a servo.

    Attributes:
        id: of the servo.
        error: bits of `tables.ERROR_BITS`.
        data: that was read.
    """

    id: int
    error: int
    data: bytes


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


def read_packet(id: int, register: Register) -> bytes:
    """Encode the read of a register."""
    return encode_packet(id, READ, bytes((register.address, register.size)))


def write_packet(id: int, register: Register, value: int) -> bytes:
    """Encode the write of a register."""
    parameters = bytes((register.address,)) + encode_value(value, register)
    return encode_packet(id, WRITE, parameters)


def sync_read_packet(ids: Sequence[int], register: Register) -> bytes:
    """Encode the read of a register of several servos, which answer in this order."""
    parameters = bytes((register.address, register.size, *ids))
    return encode_packet(BROADCAST, SYNC_READ, parameters)


def sync_write_packet(values: Mapping[int, int], register: Register) -> bytes:
    """Encode the write of a register of several servos, which do not answer."""
    parameters = bytearray((register.address, register.size))
    for id, value in values.items():
        parameters.append(id)
        parameters += encode_value(value, register)
    return encode_packet(BROADCAST, SYNC_WRITE, bytes(parameters))


def checksum(body: bytes) -> int:
    """Return the checksum of everything between header and checksum."""
    return ~sum(body) & 0xFF


def encode_value(value: int, register: Register) -> bytes:
    """Encode a whole number, with sign and magnitude if the register has a sign bit.

    Raises:
        BusError: the register cannot hold the value.
    """
    value = index(value)
    sign_bit = register.sign_bit
    bits = 8 * register.size if sign_bit is None else sign_bit
    low = 0 if sign_bit is None else 1 - 2**bits
    if not low <= value < 2**bits:
        raise BusError(
            f"register {register.address} cannot hold {value}; "
            f"it takes {low} to {2**bits - 1}"
        )
    sign = 2**bits if value < 0 else 0
    return (abs(value) | sign).to_bytes(register.size, "little")


def decode_value(data: bytes, register: Register) -> int:
    """Decode the bytes of a register."""
    value = int.from_bytes(data, "little")
    if register.sign_bit is None:
        return value
    sign = 1 << register.sign_bit
    magnitude = value & (sign - 1)
    return -magnitude if value & sign else magnitude


def value_in_block(data: bytes, block: Register, register: Register) -> int:
    """Decode a register from the bytes of a block that contains it."""
    start = register.address - block.address
    return decode_value(data[start : start + register.size], register)


def take_answers(buffer: bytearray, ids: set[int], size: int) -> list[Answer]:
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


def _answer_at_start(buffer: bytearray, ids: set[int], size: int) -> Answer | None:
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
