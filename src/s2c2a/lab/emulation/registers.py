"""Control table of a servo: named registers at addresses, with access and range."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, partial


@dataclass(frozen=True)
class EmulatedRegister:
    """One value of a control table, little endian.

    Attributes:
        name: of the value.
        address: of its first byte.
        size: number of bytes.
        initial: value of a new servo.
        low: smallest value that instructions may write.
        high: largest value that instructions may write.
        values: the only values that instructions may write; empty: the whole range.
        sign_bit: bit of the sign of sign-magnitude numbers; None: two's complement.
        writable: whether instructions may change it.
        eeprom: whether it survives a restart, and is locked while the torque is on.
    """

    name: str
    address: int
    size: int
    initial: int = 0
    low: int = 0
    high: int = 0
    values: tuple[int, ...] = ()
    sign_bit: int | None = None
    writable: bool = False
    eeprom: bool = False

    @cached_property
    def end(self) -> int:
        """Address after the last byte."""
        return self.address + self.size

    @cached_property
    def signed(self) -> bool:
        """Whether the value can be negative in two's complement."""
        return self.low < 0 and self.sign_bit is None

    def allows(self, value: int) -> bool:
        """Return whether instructions may write a value."""
        if self.values:
            return value in self.values
        return self.low <= value <= self.high

    def encode(self, value: int) -> bytes:
        """Return the bytes of a value; the nearest one that fits."""
        bits = 8 * self.size
        if self.sign_bit is not None:
            largest = (1 << self.sign_bit) - 1
            magnitude = min(abs(value), largest)
            return (magnitude | (value < 0) << self.sign_bit).to_bytes(
                self.size, "little"
            )
        lowest = -(1 << (bits - 1)) if self.signed else 0
        highest = lowest + (1 << bits) - 1
        fitting = min(max(value, lowest), highest)
        return fitting.to_bytes(self.size, "little", signed=self.signed)

    def decode(self, data: bytes | bytearray) -> int:
        """Return the value of bytes."""
        value = int.from_bytes(data, "little", signed=self.signed)
        if self.sign_bit is None:
            return value
        sign = 1 << self.sign_bit
        return -(value & (sign - 1)) if value & sign else value


class ControlTable:
    """Registers of a model of servo, by name and by address."""

    def __init__(self, registers: Iterable[EmulatedRegister]):
        """Index the registers."""
        self.registers = tuple(registers)
        self.by_name = {register.name: register for register in self.registers}
        self.size = max(register.end for register in self.registers)
        self.by_address = {register.address: register for register in self.registers}

    def initial_memory(self) -> bytearray:
        """Return the bytes of a new servo; addresses without a register hold zero."""
        memory = bytearray(self.size)
        for register in self.registers:
            memory[register.address : register.end] = register.encode(register.initial)
        return memory


measured = EmulatedRegister
"""A measurement."""
volatile = partial(EmulatedRegister, writable=True)
"""A setting that a restart resets."""
stored = partial(EmulatedRegister, writable=True, eeprom=True)
"""A setting that survives a restart."""
constant = partial(EmulatedRegister, eeprom=True)
"""What a servo states of itself."""
