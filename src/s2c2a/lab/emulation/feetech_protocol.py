"""Protocol of Feetech's SCS and STS servos, the side of the servos, from the manual."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from s2c2a.lab.emulation.answers import Answer
from s2c2a.lab.emulation.servo import Reason, RefusalError, Servo
from s2c2a.lab.emulation.stream import StreamDecoder

HEADER = b"\xff\xff"
BROADCAST = 0xFE
PING = 0x01
READ = 0x02
WRITE = 0x03
REG_WRITE = 0x04
ACTION = 0x05
REBOOT = 0x08
SYNC_READ = 0x82
SYNC_WRITE = 0x83
INSTRUCTION_ERROR = 0x10

_PREFIX = 4  # bytes: header, id, length


def checksum(data: bytes) -> int:
    """Return the inverted low byte of the sum of bytes."""
    return ~sum(data) & 0xFF


def pack(id: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return an instruction packet, or an answer with its error byte in that place."""
    body = bytes((id, len(parameters) + 2, instruction)) + parameters
    return HEADER + body + bytes((checksum(body),))


@dataclass(frozen=True)
class Packet:
    """An instruction packet.

    Attributes:
        id: of the servo, or `BROADCAST`.
        instruction: its number.
        parameters: what follows.
    """

    id: int
    instruction: int
    parameters: bytes


class Decoder(StreamDecoder[Packet]):
    """Finds packets in a stream of bytes; damaged ones are dropped."""

    def _take(self) -> Packet | None:
        """Remove the first complete packet from the buffer."""
        while True:
            start = self._buffer.find(HEADER)
            if start < 0:
                del self._buffer[:-1]
                return None
            del self._buffer[:start]
            if len(self._buffer) < _PREFIX:
                return None
            id = self._buffer[2]
            length = self._buffer[3]
            end = _PREFIX + length
            if id > BROADCAST or length < 2:
                del self._buffer[0]
                continue
            if len(self._buffer) < end:
                return None
            packet = bytes(self._buffer[:end])
            if checksum(packet[2:-1]) != packet[-1]:
                del self._buffer[0]
                continue
            del self._buffer[:end]
            return Packet(id, packet[_PREFIX], packet[_PREFIX + 1 : -1])


def status(servo: Servo, error: int = 0, parameters: bytes = b"") -> Answer:
    """Return the answer of a servo, with its hardware errors."""
    data = pack(servo.id, error | servo["hardware_error"], parameters)
    return Answer(servo.id, data, servo.return_delay)


def answer(packet: Packet, servos: Sequence[Servo], now: float) -> list[Answer]:
    """Let servos execute an instruction; returns their answers in order.

    Args:
        packet: the instruction.
        servos: that listen, at the baud rate of the line.
        now: time [s].
    """
    if packet.instruction == SYNC_READ:
        return _sync_read(packet.parameters, servos)
    if packet.instruction == SYNC_WRITE:
        return _sync_write(packet.parameters, servos)
    answers = []
    for servo in servos:
        if packet.id not in (servo.id, BROADCAST):
            continue
        given = _answer_alone(packet, servo, now)
        if given and (packet.id != BROADCAST or packet.instruction == PING):
            answers.append(given)
    return sorted(answers, key=lambda given: given.id)


def _answer_alone(packet: Packet, servo: Servo, now: float) -> Answer | None:
    """Let one servo execute an instruction; returns its answer, if it gives one."""
    always = packet.instruction in (PING, READ)
    answers = always or servo.answers_writes
    try:
        result = _ALONE[packet.instruction](packet.parameters, servo, now)
        given = status(servo, 0, result)
    except (RefusalError, KeyError):
        given = status(servo, INSTRUCTION_ERROR)
    return given if answers else None


def _ping(parameters: bytes, servo: Servo, now: float) -> bytes:
    return b""


def _read(parameters: bytes, servo: Servo, now: float) -> bytes:
    if len(parameters) != 2:
        raise RefusalError(Reason.LENGTH)
    return servo.read(parameters[0], parameters[1])


def _write(parameters: bytes, servo: Servo, now: float) -> bytes:
    if len(parameters) < 2:
        raise RefusalError(Reason.LENGTH)
    servo.write(parameters[0], parameters[1:])
    return b""


def _register(parameters: bytes, servo: Servo, now: float) -> bytes:
    if len(parameters) < 2:
        raise RefusalError(Reason.LENGTH)
    servo.registered = parameters[0], parameters[1:]
    servo["registered_instruction"] = 1
    return b""


def _act(parameters: bytes, servo: Servo, now: float) -> bytes:
    if servo.registered is None:
        return b""
    address, data = servo.registered
    servo.registered = None
    servo["registered_instruction"] = 0
    servo.write(address, data)
    return b""


def _reboot(parameters: bytes, servo: Servo, now: float) -> bytes:
    servo.restart(now)
    return b""


_ALONE: dict[int, Callable[[bytes, Servo, float], bytes]] = {
    PING: _ping,
    READ: _read,
    WRITE: _write,
    REG_WRITE: _register,
    ACTION: _act,
    REBOOT: _reboot,
}


def _sync_read(parameters: bytes, servos: Sequence[Servo]) -> list[Answer]:
    """Answer in the order of the ids, up to an absent servo; the others wait for it."""
    by_id = {servo.id: servo for servo in servos}
    answers: list[Answer] = []
    if len(parameters) < 2:
        return answers
    address, size = parameters[:2]
    for id in parameters[2:]:
        if id not in by_id:
            break
        servo = by_id[id]
        try:
            answers.append(status(servo, 0, servo.read(address, size)))
        except RefusalError:
            answers.append(status(servo, INSTRUCTION_ERROR, bytes(size)))
    return answers


def _sync_write(parameters: bytes, servos: Sequence[Servo]) -> list[Answer]:
    """Execute writes, which no servo answers."""
    by_id = {servo.id: servo for servo in servos}
    if len(parameters) < 2:
        return []
    address, size = parameters[:2]
    for start in range(2, len(parameters) - size, size + 1):
        servo = by_id.get(parameters[start])
        if servo is None:
            continue
        try:
            servo.write(address, parameters[start + 1 : start + 1 + size])
        except RefusalError:
            continue
    return []
