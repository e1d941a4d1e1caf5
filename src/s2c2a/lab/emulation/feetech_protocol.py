"""Protocol of Feetech's SCS and STS servos, the side of the servos, from the manual."""

from s2c2a.lab.emulation.instructions import (
    BROADCAST,
    Instruction,
    PacketDecoder,
    Reply,
    ServoProtocol,
)
from s2c2a.lab.emulation.servo import Reason, Servo
from s2c2a.lab.emulation.sts3215 import STS3215

HEADER = b"\xff\xff"
INSTRUCTION_ERROR = 0x10


def checksum(data: bytes) -> int:
    """Return the inverted low byte of the sum of bytes."""
    return ~sum(data) & 0xFF


def pack(id: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return an instruction packet, or an answer with its error byte in that place."""
    body = bytes((id, len(parameters) + 2, instruction)) + parameters
    return HEADER + body + bytes((checksum(body),))


class FeetechDecoder(PacketDecoder):
    """Finds packets in a stream of bytes; damaged ones are dropped."""

    header = HEADER
    prefix = 4  # header, id, length

    def _size(self) -> int:
        id = self._buffer[2]
        length = self._buffer[3]
        return 0 if id > BROADCAST or length < 2 else self.prefix + length

    def _unpack(self, packet: bytes) -> Instruction | None:
        if checksum(packet[2:-1]) != packet[-1]:
            return None
        start = self.prefix
        return Instruction(packet[2], packet[start], packet[start + 1 : -1])


class FeetechProtocol(ServoProtocol):
    """Feetech's protocol, with the error bits of the servo in every answer."""

    decoder = FeetechDecoder
    make_servo = STS3215
    supply = 7.4
    word = 1
    codes = dict.fromkeys(Reason, INSTRUCTION_ERROR)

    def status(self, servo: Servo, error: int = 0, parameters: bytes = b"") -> Reply:
        """See `ServoProtocol.status`."""
        data = pack(servo.id, error | servo["hardware_error"], parameters)
        return Reply(servo.id, data, servo.return_delay)
