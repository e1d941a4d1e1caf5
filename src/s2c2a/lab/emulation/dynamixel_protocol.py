"""DYNAMIXEL protocol 2.0, the side of the servos, from its e-manual (ROBOTIS)."""

from collections.abc import Sequence

from s2c2a.lab.emulation.instructions import (
    BROADCAST,
    Instruction,
    PacketDecoder,
    Reply,
    ServoProtocol,
)
from s2c2a.lab.emulation.servo import Reason, Servo
from s2c2a.lab.emulation.xl330 import XL330

HEADER = b"\xff\xff\xfd\x00"
STATUS = 0x55
FAST_SYNC_READ = 0x8A
ALERT = 0x80
CRC_ERROR = 0x03

_MAX_LENGTH = 1024  # of a packet
_PREFIX = 7  # bytes: header, id, length
_CODES = {
    Reason.FAILED: 0x01,
    Reason.INSTRUCTION: 0x02,
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


class DynamixelDecoder(PacketDecoder):
    """Finds packets in a stream of bytes.

    A packet that contains another header is given up: its sender did not stuff it, or
    broke off.
    """

    header = HEADER
    prefix = _PREFIX

    def _size(self) -> int:
        end = _PREFIX + int.from_bytes(self._buffer[5:_PREFIX], "little")
        is_size = _PREFIX + 3 <= end <= _MAX_LENGTH
        return end if is_size and self._second_header(end) < 0 else 0

    def _second_header(self, end: int) -> int:
        """Return where an unstuffed FF FF FD stands in the first packet, or -1."""
        start = self._buffer.find(b"\xff\xff\xfd", _PREFIX, end - 2)
        while start >= 0 and start + 3 < min(end - 2, len(self._buffer)):
            if self._buffer[start + 3] != 0xFD:
                return start
            start = self._buffer.find(b"\xff\xff\xfd", start + 4, end - 2)
        return -1

    def _unpack(self, packet: bytes) -> Instruction:
        body = unstuff(packet[_PREFIX:-2])
        sent = int.from_bytes(packet[-2:], "little")
        intact = crc16(packet[:-2]) == sent
        return Instruction(packet[4], body[0], body[1:], intact)


class DynamixelProtocol(ServoProtocol):
    """DYNAMIXEL protocol 2.0: CRC, fast reads, and a watchdog that hears everything."""

    decoder = DynamixelDecoder
    make_servo = XL330
    supply = 5.0
    stuffs = True
    word = 2
    codes = _CODES

    def status(self, servo: Servo, error: int = 0, parameters: bytes = b"") -> Reply:
        """See `ServoProtocol.status`; the alert bit stands for hardware errors."""
        errors = bytes((error | _alert(servo),))
        data = pack(servo.id, STATUS, errors + parameters)
        return Reply(servo.id, data, servo.return_delay)

    def answer(
        self, packet: Instruction, servos: Sequence[Servo], now: float
    ) -> list[Reply]:
        """See `ServoProtocol.answer`."""
        if packet.instruction == STATUS:
            return []
        if not packet.intact:
            return [
                self.status(servo, CRC_ERROR)
                for servo in servos
                if servo.id == packet.id and servo.answers_writes
            ]
        for servo in servos:
            servo.hear(now)
        if packet.instruction == FAST_SYNC_READ:
            # answer a fast read: one packet to which all servos contribute
            parameters = packet.parameters
            _, size = self._span(parameters)
            length = 1 + (size + 4) * len(parameters[2 * self.word :])
            if length > _MAX_LENGTH:
                return []
            part = HEADER + bytes((BROADCAST,)) + length.to_bytes(2, "little")
            part += bytes((STATUS,))
            answers: list[Reply] = []
            crc = 0
            for servo, error, data in self._read_in_turn(parameters, servos):
                part += bytes((error | _alert(servo), servo.id)) + data
                crc = crc16(part, crc)
                ending = crc.to_bytes(2, "little")
                crc = crc16(ending, crc)
                delay = 0.0 if answers else servo.return_delay
                answers.append(Reply(servo.id, part + ending, delay))
                part = b""
            return answers
        return super().answer(packet, servos, now)

    def _identity(self, servo: Servo) -> bytes:
        return servo.read(0, 2) + servo.read(6, 1)


def _alert(servo: Servo) -> int:
    return ALERT if servo.errors else 0
