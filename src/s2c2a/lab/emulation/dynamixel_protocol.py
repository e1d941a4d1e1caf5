"""DYNAMIXEL protocol 2.0, the side of the servos, from its e-manual (ROBOTIS)."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

from s2c2a.lab.emulation.answers import Answer
from s2c2a.lab.emulation.servo import Reason, RefusalError, Servo
from s2c2a.lab.emulation.stream import StreamDecoder

HEADER = b"\xff\xff\xfd\x00"
BROADCAST = 0xFE
STATUS = 0x55
ALERT = 0x80
CRC_ERROR = 0x03
INSTRUCTION_ERROR = 0x02
PING = 0x01
READ = 0x02
WRITE = 0x03
REG_WRITE = 0x04
ACTION = 0x05
FACTORY_RESET = 0x06
REBOOT = 0x08
CLEAR = 0x10
SYNC_READ = 0x82
SYNC_WRITE = 0x83
FAST_SYNC_READ = 0x8A
BULK_READ = 0x92
BULK_WRITE = 0x93
FAST_BULK_READ = 0x9A
CLEAR_TURNS = b"\x01\x44\x58\x4c\x22"

_MAX_LENGTH = 1024  # of a packet
_PREFIX = 7  # bytes: header, id, length
_CODES = {
    Reason.FAILED: 0x01,
    Reason.RANGE: 0x04,
    Reason.LENGTH: 0x05,
    Reason.LIMIT: 0x06,
    Reason.ACCESS: 0x07,
}


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        value = byte << 8
        for _ in range(8):
            carry = value & 0x8000
            value = (value << 1) & 0xFFFF
            if carry:
                value ^= 0x8005
        table.append(value)
    return tuple(table)


_CRC_TABLE = _crc_table()


def crc16(data: bytes, start: int = 0) -> int:
    """Return the CRC-16 of bytes: polynomial 0x8005, most significant bit first.

    Args:
        data: the bytes.
        start: the CRC of bytes before them.
    """
    value = start
    for byte in data:
        value = ((value << 8) & 0xFFFF) ^ _CRC_TABLE[(value >> 8) ^ byte]
    return value


def stuff(data: bytes) -> bytes:
    """Insert FD after each FF FF FD, so that no header occurs in a packet."""
    return data.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")


def unstuff(data: bytes) -> bytes:
    """Remove what `stuff` inserted."""
    return data.replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")


def pack(id: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return an instruction packet, or the packet of a status with its error byte."""
    body = stuff(bytes((instruction,)) + parameters)
    length = len(body) + 2
    packet = HEADER + bytes((id,)) + length.to_bytes(2, "little") + body
    return packet + crc16(packet).to_bytes(2, "little")


@dataclass(frozen=True)
class Packet:
    """An instruction packet.

    Attributes:
        id: of the servo, or `BROADCAST`.
        instruction: its number.
        parameters: without stuffing.
        intact: whether the CRC is right.
    """

    id: int
    instruction: int
    parameters: bytes
    intact: bool = True


class Decoder(StreamDecoder[Packet]):
    """Finds packets in a stream of bytes.

    A packet that contains another header is given up: its sender did not stuff it, or
    broke off.
    """

    def _take(self) -> Packet | None:
        """Remove the first complete packet from the buffer."""
        while True:
            start = self._buffer.find(HEADER)
            if start < 0:
                del self._buffer[:-3]
                return None
            del self._buffer[:start]
            if len(self._buffer) < _PREFIX:
                return None
            length = int.from_bytes(self._buffer[5:_PREFIX], "little")
            end = _PREFIX + length
            second = self._second_header(end)
            if length < 3 or end > _MAX_LENGTH or second > 0:
                del self._buffer[: max(second, len(HEADER))]
                continue
            if len(self._buffer) < end:
                return None
            packet = bytes(self._buffer[:end])
            del self._buffer[:end]
            return _unpack(packet)

    def _second_header(self, end: int) -> int:
        """Return where an unstuffed FF FF FD stands in the first packet, or -1."""
        start = self._buffer.find(b"\xff\xff\xfd", _PREFIX, end - 2)
        while start >= 0 and start + 3 < min(end - 2, len(self._buffer)):
            if self._buffer[start + 3] != 0xFD:
                return start
            start = self._buffer.find(b"\xff\xff\xfd", start + 4, end - 2)
        return -1


def _unpack(packet: bytes) -> Packet:
    body = unstuff(packet[_PREFIX:-2])
    intact = crc16(packet[:-2]) == int.from_bytes(packet[-2:], "little")
    return Packet(packet[4], body[0], body[1:], intact)


def status(servo: Servo, error: int = 0, parameters: bytes = b"") -> Answer:
    """Return the answer of a servo, with the alert bit if it has hardware errors."""
    data = pack(servo.id, STATUS, bytes((error | _alert(servo),)) + parameters)
    return Answer(servo.id, data, servo.return_delay)


def _alert(servo: Servo) -> int:
    return ALERT if servo.errors else 0


def answer(packet: Packet, servos: Sequence[Servo], now: float) -> list[Answer]:
    """Let servos execute an instruction; returns their answers in order.

    Args:
        packet: the instruction.
        servos: that listen, at the baud rate of the line.
        now: time [s].
    """
    if packet.instruction == STATUS:
        return []
    if not packet.intact:
        addressed = [servo for servo in servos if servo.id == packet.id]
        return [status(servo, CRC_ERROR) for servo in addressed if servo.answers_writes]
    for servo in servos:
        servo.hear(now)
    if packet.instruction in _SHARED:
        return _SHARED[packet.instruction](packet.parameters, servos, now)
    addressed = [servo for servo in servos if packet.id in (servo.id, BROADCAST)]
    answers = []
    for servo in sorted(addressed, key=lambda servo: servo.id):
        given = _answer_alone(packet, servo, now)
        # Only a ping is answered by all.
        if given and (packet.id != BROADCAST or packet.instruction == PING):
            answers.append(given)
    return answers


def _answer_alone(packet: Packet, servo: Servo, now: float) -> Answer | None:
    """Let one servo execute an instruction; returns its answer, if it gives one."""
    instruction = packet.instruction
    answers = servo.answers_writes
    if instruction == PING:
        answers = True
    if instruction == READ:
        answers = servo.answers_reads
    try:
        result = _execute(packet, servo, now)
        given = status(servo, 0, result)
    except RefusalError as refusal:
        given = status(servo, _CODES[refusal.reason])
    except KeyError:
        given = status(servo, INSTRUCTION_ERROR)
    return given if answers else None


def _execute(packet: Packet, servo: Servo, now: float) -> bytes:
    """Execute an instruction to one servo; returns what it reads."""
    return _ALONE[packet.instruction](packet.parameters, servo, now)


def _ping(parameters: bytes, servo: Servo, now: float) -> bytes:
    return servo.read(0, 2) + servo.read(6, 1)


def _read(parameters: bytes, servo: Servo, now: float) -> bytes:
    if len(parameters) != 4:
        raise RefusalError(Reason.LENGTH)
    return servo.read(_word(parameters, 0), _word(parameters, 2))


def _write(parameters: bytes, servo: Servo, now: float) -> bytes:
    if len(parameters) < 3:
        raise RefusalError(Reason.LENGTH)
    servo.write(_word(parameters, 0), parameters[2:])
    return b""


def _register(parameters: bytes, servo: Servo, now: float) -> bytes:
    if len(parameters) < 3:
        raise RefusalError(Reason.LENGTH)
    servo.registered = _word(parameters, 0), parameters[2:]
    servo["registered_instruction"] = 1
    return b""


def _act(parameters: bytes, servo: Servo, now: float) -> bytes:
    if servo.registered is None:
        raise RefusalError(Reason.FAILED)
    address, data = servo.registered
    servo.registered = None
    servo["registered_instruction"] = 0
    servo.write(address, data)
    return b""


def _refuse(parameters: bytes, servo: Servo, now: float) -> bytes:
    raise RefusalError(Reason.FAILED)


def _reboot(parameters: bytes, servo: Servo, now: float) -> bytes:
    servo.restart(now)
    return b""


def _clear(parameters: bytes, servo: Servo, now: float) -> bytes:
    if parameters != CLEAR_TURNS or servo["moving"]:
        raise RefusalError(Reason.FAILED)
    servo.forget_turns()
    return b""


_ALONE: dict[int, Callable[[bytes, Servo, float], bytes]] = {
    PING: _ping,
    READ: _read,
    WRITE: _write,
    REG_WRITE: _register,
    ACTION: _act,
    FACTORY_RESET: _refuse,
    REBOOT: _reboot,
    CLEAR: _clear,
}

# An id, and the address and the size or the data for it.
_Request = tuple[int, int, int]


def _word(data: bytes, start: int) -> int:
    return int.from_bytes(data[start : start + 2], "little")


def _sync_requests(parameters: bytes) -> list[_Request]:
    address = _word(parameters, 0)
    size = _word(parameters, 2)
    return [(id, address, size) for id in parameters[4:]]


def _bulk_requests(parameters: bytes) -> list[_Request]:
    starts = range(0, len(parameters) - 4, 5)
    return [
        (parameters[start], _word(parameters, start + 1), _word(parameters, start + 3))
        for start in starts
    ]


def _read_in_turn(
    requests: list[_Request], servos: Sequence[Servo], now: float
) -> Iterable[tuple[Servo, int, bytes]]:
    """Yield servo, error byte and data of every request, up to an absent servo.

    Every servo waits for the answer of the one before it: the servos behind an absent
    one stay silent.
    """
    by_id = {servo.id: servo for servo in servos}
    for id, address, size in requests:
        servo = by_id.get(id)
        if servo is None or not servo.answers_reads or size > _MAX_LENGTH:
            return
        try:
            yield servo, _alert(servo), servo.read(address, size)
        except RefusalError as refusal:
            # An answer has the requested size.
            yield servo, _CODES[refusal.reason] | _alert(servo), bytes(size)


def _read_several(
    find_requests, parameters: bytes, servos: Sequence[Servo], now: float
) -> list[Answer]:
    """Answer a sync read or a bulk read: one packet a servo."""
    requests = find_requests(parameters)
    return [
        status(servo, error, data)
        for servo, error, data in _read_in_turn(requests, servos, now)
    ]


def _read_fast(
    find_requests, parameters: bytes, servos: Sequence[Servo], now: float
) -> list[Answer]:
    """Answer a fast read: one packet to which all servos contribute.

    Its length is sent before the data of the later servos are known, so its data are
    not stuffed. Every servo ends its part with the CRC of all bytes so far.
    """
    requests = find_requests(parameters)
    length = 1 + sum(size + 4 for _, _, size in requests)
    if length > _MAX_LENGTH:
        return []
    part = HEADER + bytes((BROADCAST,)) + length.to_bytes(2, "little")
    part += bytes((STATUS,))
    answers: list[Answer] = []
    crc = 0
    for servo, error, data in _read_in_turn(requests, servos, now):
        part += bytes((error, servo.id)) + data
        crc = crc16(part, crc)
        ending = crc.to_bytes(2, "little")
        crc = crc16(ending, crc)
        delay = 0.0 if answers else servo.return_delay
        answers.append(Answer(servo.id, part + ending, delay))
        part = b""
    return answers


def _write_each(
    writes: Iterable[tuple[int, int, bytes]], servos: Sequence[Servo], now: float
) -> list[Answer]:
    """Execute writes (id, address, data), which no servo answers."""
    by_id = {servo.id: servo for servo in servos}
    for id, address, data in writes:
        servo = by_id.get(id)
        if servo is None:
            continue
        try:
            servo.write(address, data)
        except RefusalError:
            continue
    return []


def _sync_write(parameters: bytes, servos: Sequence[Servo], now: float) -> list[Answer]:
    address = _word(parameters, 0)
    size = _word(parameters, 2)
    starts = range(4, len(parameters) - size, size + 1)
    writes = (
        (parameters[start], address, parameters[start + 1 : start + 1 + size])
        for start in starts
    )
    return _write_each(writes, servos, now)


def _bulk_write(parameters: bytes, servos: Sequence[Servo], now: float) -> list[Answer]:
    writes = []
    start = 0
    while start + 5 <= len(parameters):
        size = _word(parameters, start + 3)
        data = parameters[start + 5 : start + 5 + size]
        writes.append((parameters[start], _word(parameters, start + 1), data))
        start += 5 + size
    return _write_each(writes, servos, now)


_SHARED: dict[int, Callable[[bytes, Sequence[Servo], float], list[Answer]]] = {
    SYNC_READ: partial(_read_several, _sync_requests),
    BULK_READ: partial(_read_several, _bulk_requests),
    FAST_SYNC_READ: partial(_read_fast, _sync_requests),
    FAST_BULK_READ: partial(_read_fast, _bulk_requests),
    SYNC_WRITE: _sync_write,
    BULK_WRITE: _bulk_write,
}
