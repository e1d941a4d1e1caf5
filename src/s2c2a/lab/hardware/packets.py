"""Registers, instructions and answers of servo buses, whatever the protocol."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import index
from typing import ClassVar

from s2c2a.lab.hardware.bus import BusError

PING = 0x01
READ = 0x02
WRITE = 0x03
SYNC_READ = 0x82
SYNC_WRITE = 0x83
BROADCAST = 254


@dataclass(frozen=True)
class Register:
    """Address and encoding of a value, little-endian.

    Attributes:
        address: of its first byte.
        size: [bytes].
        signed: whether it is a two's complement.
        sign_bit: bit that makes the value negative (sign and magnitude); None if there
            is none.
    """

    address: int
    size: int = 1
    signed: bool = False
    sign_bit: int | None = None

    @property
    def range(self) -> tuple[int, int]:
        """Smallest and largest value."""
        bits = 8 * self.size
        if self.sign_bit is not None:
            return 1 - 2**self.sign_bit, 2**self.sign_bit - 1
        if self.signed:
            return -(2 ** (bits - 1)), 2 ** (bits - 1) - 1
        return 0, 2**bits - 1

    def encode(self, value: int) -> bytes:
        """Return the bytes of a whole number.

        Raises:
            BusError: the register cannot hold it.
        """
        value = index(value)
        low, high = self.range
        if not low <= value <= high:
            raise BusError(
                f"register {self.address} cannot hold {value}; it takes {low} to {high}"
            )
        if self.sign_bit is not None and value < 0:
            value = -value | 1 << self.sign_bit
        return value.to_bytes(self.size, "little", signed=self.signed)

    def decode(self, data: bytes) -> int:
        """Return the value of bytes."""
        value = int.from_bytes(data, "little", signed=self.signed)
        if self.sign_bit is None:
            return value
        sign = 1 << self.sign_bit
        magnitude = value & (sign - 1)
        return -magnitude if value & sign else magnitude

    def within(self, data: bytes, block: "Register") -> int:
        """Return the value in the bytes of a block that contains the register."""
        start = self.address - block.address
        return self.decode(data[start : start + self.size])


@dataclass(frozen=True)
class Answer:
    """Answer of a servo.

    Attributes:
        id: of the servo; `BROADCAST` for a joint answer of several.
        error: as the protocol defines it.
        data: that was read.
    """

    id: int
    error: int
    data: bytes


class AnswerReader:
    """Finds answers in a stream of bytes.

    Bytes that are no sound answer are skipped one by one, so that noise, an echo of the
    instruction or a damaged answer never costs the next answer.
    """

    def __init__(
        self,
        header: bytes,
        prefix: int,
        size_of: Callable[[bytearray], int],
        decode: Callable[[bytes], Answer | None],
    ):
        """A reader that has no bytes yet.

        Args:
            header: first bytes of an answer.
            prefix: number of bytes up to the length.
            size_of: returns the size of an answer by its first `prefix` bytes; zero if
                they begin none.
            decode: returns the content of an answer; None if it is damaged.
        """
        self._buffer = bytearray()
        self._header = header
        self._prefix = prefix
        self._size_of = size_of
        self._decode = decode

    def feed(self, data: bytes) -> Iterator[Answer]:
        """Add bytes and yield the answers that are complete."""
        self._buffer += data
        while answer := self._next():
            yield answer

    def flush(self) -> Iterator[Answer]:
        """Yield the remaining answers at the end of the stream.

        An incomplete answer is dropped; complete ones inside it are found.
        """
        while self._buffer:
            del self._buffer[0]
            yield from self.feed(b"")

    def _next(self) -> Answer | None:
        """The next sound answer, or None if more bytes are needed."""
        while self._find_header():
            size = self._size_of(self._buffer)
            if len(self._buffer) < size:
                return None
            answer = self._decode(bytes(self._buffer[:size])) if size else None
            if answer is not None:
                del self._buffer[:size]
                return answer
            del self._buffer[0]
        return None

    def _find_header(self) -> bool:
        """Drop bytes before a header; return whether the length is known."""
        start = self._buffer.find(self._header)
        if start < 0:
            # the end may be the beginning of a header
            start = max(len(self._buffer) - len(self._header) + 1, 0)
        del self._buffer[:start]
        is_long = len(self._buffer) >= self._prefix
        return is_long and self._buffer.startswith(self._header)


class ServoPackets(ABC):
    """Packets of one protocol.

    Attributes:
        word: bytes of an address, and of a size.
        overhead: bytes of an answer besides its data.
    """

    word: ClassVar[int]
    overhead: ClassVar[int]

    @abstractmethod
    def encode(self, id: int, instruction: int, parameters: bytes = b"") -> bytes:
        """Return the bytes of an instruction."""

    @abstractmethod
    def reader(self, ids: Collection[int], size: int) -> AnswerReader:
        """Return a reader of answers.

        Args:
            ids: of the servos that may answer.
            size: of the data in an answer [bytes].
        """

    def span(self, register: Register) -> bytes:
        """Return address and size of a register, as parameters."""
        address = register.address.to_bytes(self.word, "little")
        return address + register.size.to_bytes(self.word, "little")

    def read(self, id: int, register: Register) -> bytes:
        """Encode the read of a register."""
        return self.encode(id, READ, self.span(register))

    def write(self, id: int, register: Register, value: int) -> bytes:
        """Encode the write of a register."""
        address = register.address.to_bytes(self.word, "little")
        return self.encode(id, WRITE, address + register.encode(value))

    def sync_read(self, ids: Sequence[int], register: Register) -> bytes:
        """Encode the read of a register of servos, which answer in this order."""
        return self.encode(BROADCAST, SYNC_READ, self.span(register) + bytes(ids))

    def sync_write(self, values: Mapping[int, int], register: Register) -> bytes:
        """Encode the write of a register of several servos, which do not answer."""
        parameters = bytearray(self.span(register))
        for id, value in values.items():
            parameters.append(id)
            parameters += register.encode(value)
        return self.encode(BROADCAST, SYNC_WRITE, bytes(parameters))
