"""Instructions to bus servos and their answers, whatever the form of the packets."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar

from s2c2a.lab.emulation.servo import Reason, RefusalError, Servo

BROADCAST = 0xFE
PING = 0x01
READ = 0x02
WRITE = 0x03
REBOOT = 0x08
SYNC_READ = 0x82
SYNC_WRITE = 0x83
STALE = 0.1  # s; the rest of a packet does not come later than this
_MAX_SIZE = 1024  # bytes that a servo returns


@dataclass(frozen=True)
class Instruction:
    """An instruction packet.

    Attributes:
        id: of the servo, or `BROADCAST`.
        instruction: its number.
        parameters: what follows, without stuffing.
        intact: whether the checksum is right.
    """

    id: int
    instruction: int
    parameters: bytes
    intact: bool = True


@dataclass(frozen=True)
class Reply:
    """Bytes that one servo sends.

    Attributes:
        id: of the servo.
        data: the bytes.
        delay: time between the end of what was sent before and the first byte [s].
    """

    id: int
    data: bytes
    delay: float


class PacketDecoder(ABC):
    """Finds packets in bytes that come in pieces.

    A subclass knows the form of a packet.

    Attributes:
        header: first bytes of a packet.
        prefix: number of bytes up to the length.
    """

    header: ClassVar[bytes]
    prefix: ClassVar[int]

    def __init__(self):
        self._buffer = bytearray()
        self._fed = 0.0

    def feed(self, data: bytes, now: float) -> list[Instruction]:
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

    def _take(self) -> Instruction | None:
        """Remove the first complete packet from the buffer, and all before it."""
        while self._find_header():
            size = self._size()
            if len(self._buffer) < size:
                return None
            packet = self._unpack(bytes(self._buffer[:size])) if size else None
            if packet is not None:
                del self._buffer[:size]
                return packet
            del self._buffer[0]
        return None

    def _find_header(self) -> bool:
        """Drop bytes before a header; return whether the length has come."""
        start = self._buffer.find(self.header)
        if start < 0:
            del self._buffer[: 1 - len(self.header)]
            return False
        del self._buffer[:start]
        return len(self._buffer) >= self.prefix

    @abstractmethod
    def _size(self) -> int:
        """Return the size of the packet at the start of the buffer; 0 if it is none."""

    @abstractmethod
    def _unpack(self, packet: bytes) -> Instruction | None:
        """Return the content of a packet; None to drop it."""


class ServoProtocol(ABC):
    """The side of the servos in a protocol: they execute instructions and answer.

    Attributes:
        decoder: finds the instructions in a stream of bytes.
        make_servo: makes a servo of an id, a state of its motor, and a firmware.
        supply: nominal voltage [V].
        stuffs: whether packets are byte-stuffed.
        word: bytes of an address, and of a size.
        codes: error of an answer by the reason of a refusal.
    """

    decoder: ClassVar[type[PacketDecoder]]
    make_servo: ClassVar[type[Servo]]
    supply: ClassVar[float]
    stuffs: ClassVar[bool] = False
    word: ClassVar[int]
    codes: ClassVar[Mapping[Reason, int]]

    @abstractmethod
    def status(self, servo: Servo, error: int = 0, parameters: bytes = b"") -> Reply:
        """Return the answer of a servo, with its hardware errors."""

    def answer(
        self, packet: Instruction, servos: Sequence[Servo], now: float
    ) -> list[Reply]:
        """Let servos execute an instruction; returns their answers in order.

        Args:
            packet: the instruction.
            servos: that listen, at the baud rate of the line.
            now: time [s].
        """
        if packet.instruction == SYNC_READ:
            return [
                self.status(*part)
                for part in self._read_in_turn(packet.parameters, servos)
            ]
        if packet.instruction == SYNC_WRITE:
            self._write_each(packet.parameters, servos)
            return []
        addressed = [
            servo
            for servo in servos
            if packet.id == BROADCAST or servo.obeys(packet.id)
        ]
        answers = []
        for servo in sorted(addressed, key=lambda servo: servo.id):
            given = self._answer_alone(packet, servo, now)
            # Only a ping is answered by all; nobody answers to a secondary id.
            asked = packet.id == servo.id
            if packet.id == BROADCAST:
                asked = packet.instruction == PING
            if given and asked:
                answers.append(given)
        return answers

    def _answer_alone(
        self, packet: Instruction, servo: Servo, now: float
    ) -> Reply | None:
        """Let one servo execute an instruction; returns its answer, if it gives one."""
        answers = servo.answers_writes
        if packet.instruction == PING:
            answers = True
        if packet.instruction == READ:
            answers = servo.answers_reads
        try:
            given = self.status(servo, 0, self._execute(packet, servo, now))
        except RefusalError as refusal:
            given = self.status(servo, self.codes[refusal.reason])
        return given if answers else None

    def _execute(self, packet: Instruction, servo: Servo, now: float) -> bytes:
        """Execute an instruction to one servo; returns what it reads."""
        parameters = packet.parameters
        if packet.instruction == PING:
            return self._identity(servo)
        if packet.instruction == READ:
            if len(parameters) != 2 * self.word:
                raise RefusalError(Reason.LENGTH)
            return servo.read(*self._span(parameters))
        if packet.instruction == WRITE:
            if len(parameters) <= self.word:
                raise RefusalError(Reason.LENGTH)
            servo.write(self._span(parameters)[0], parameters[self.word :])
            return b""
        if packet.instruction == REBOOT:
            servo.restart(now)
            return b""
        raise RefusalError(Reason.INSTRUCTION)

    def _identity(self, servo: Servo) -> bytes:
        """What a ping returns."""
        return b""

    def _span(self, parameters: bytes) -> tuple[int, int]:
        """Address and size at the beginning of parameters."""
        address = int.from_bytes(parameters[: self.word], "little")
        size = int.from_bytes(parameters[self.word : 2 * self.word], "little")
        return address, size

    def _read_in_turn(
        self, parameters: bytes, servos: Sequence[Servo]
    ) -> Iterator[tuple[Servo, int, bytes]]:
        """Yield servo, error and data of every id, up to an absent servo.

        Every servo waits for the answer of the one before it: the servos behind an
        absent one stay silent.
        """
        by_id = {servo.id: servo for servo in servos}
        address, size = self._span(parameters)
        for id in parameters[2 * self.word :]:
            servo = by_id.get(id)
            if servo is None or not servo.answers_reads or size > _MAX_SIZE:
                return
            try:
                yield servo, 0, servo.read(address, size)
            except RefusalError as refusal:
                # An answer has the requested size.
                yield servo, self.codes[refusal.reason], bytes(size)

    def _write_each(self, parameters: bytes, servos: Sequence[Servo]) -> None:
        """Execute the writes of a sync write, which no servo answers."""
        address, size = self._span(parameters)
        for start in range(2 * self.word, len(parameters) - size, size + 1):
            for servo in servos:
                if servo.obeys(parameters[start]):
                    with suppress(RefusalError):
                        servo.write(address, parameters[start + 1 : start + 1 + size])
