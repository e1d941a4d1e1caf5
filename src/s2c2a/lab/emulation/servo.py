"""Behavior of a bus servo: memory, locks, shutdown, restart; no protocol, no motor."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar

from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.registers import ControlTable, EmulatedRegister

RESTART_TIME = 0.3  # s; a servo that restarts is silent
AMBIENT = 25.0  # deg C
RETURN_DELAY_UNIT = 2e-6  # s
VOLTAGE_UNIT = 0.1  # V
_THERMAL_TIME = 150.0  # s
_HEATING = 35.0  # deg C at rest of the thermal model, per A2
_FAULT_AMBIENT = 130.0  # deg C
_FAULT_THERMAL_TIME = 10.0  # s


class Reason(Enum):
    """Reasons for which a servo refuses an instruction."""

    RANGE = "value out of range"
    LENGTH = "part of a register"
    LIMIT = "value beyond a configured limit"
    ACCESS = "register that is read-only, locked or absent"
    FAILED = "instruction that cannot be executed"
    INSTRUCTION = "instruction that does not exist"


class RefusalError(S2C2AError):
    """A servo refuses an instruction; its answer says why."""

    def __init__(self, reason: Reason):
        super().__init__(f"refused: {reason.value}")
        self.reason = reason


@dataclass(frozen=True)
class MotorCommand:
    """What a servo demands of its motor.

    Attributes:
        torque: whether the motor is powered.
        goal: position [ticks].
        speed: largest speed [rad/s].
        current: largest current [A].
    """

    torque: bool = False
    goal: float = 0.0
    speed: float = 0.0
    current: float = 0.0


@dataclass(frozen=True)
class MotorState:
    """What a servo measures at its motor.

    Attributes:
        ticks: position since the motor was built [ticks], over all turns.
        velocity: [rad/s].
        current: [A]; positive where it drives the position up.
        voltage: of the supply [V].
    """

    ticks: float = 0.0
    velocity: float = 0.0
    current: float = 0.0
    voltage: float = 5.0


class Servo(ABC):
    """A servo on a bus: control table, and what it does to the motor.

    Of the operating modes, those that wind cables are emulated: positions.

    Attributes:
        table: registers of the model.
        baud_rates: speeds of the port by the value of their register [bit/s].
        error_bits: bits of the hardware errors by name.
        ticks_per_turn: of the position.
        torque_constant: torque per current [N m/A].
        state: latest measurement at the motor.
        temperature: [deg C].
        overheats: whether a fault heats the servo.
        silent_until: end of the restart [s].
        gone_until: time until which the servo is off the bus [s].
    """

    table: ControlTable
    baud_rates: ClassVar[tuple[int, ...]]
    error_bits: ClassVar[Mapping[str, int]]
    ticks_per_turn = 4096
    torque_constant: float
    overload_current: float
    overload_time = 1.0  # s

    def __init__(self, id: int, state: MotorState, firmware: int = 0):
        """Power the servo up.

        Args:
            id: on the bus.
            state: of the motor.
            firmware: version, of models that have several.
        """
        self.memory = self.table.initial_memory()
        self.state = state
        self.temperature = AMBIENT
        self.overheats = False
        self._shift = 0
        self.silent_until = 0.0
        self.gone_until = 0.0
        self._overloaded_for = 0.0
        self._turns_lost = 0
        self["id"] = id
        self._restart(0.0)

    def __getitem__(self, name: str) -> int:
        """Return the value of a register."""
        register = self.table.by_name[name]
        return register.decode(self.memory[register.address : register.end])

    def __setitem__(self, name: str, value: int) -> None:
        """Change a register from inside: without locks and ranges."""
        self._put(self.table.by_name[name], value)

    def _put(self, register: EmulatedRegister, value: int) -> None:
        self.memory[register.address : register.end] = register.encode(value)

    @property
    def id(self) -> int:
        """Id on the bus."""
        return self["id"]

    @property
    def position(self) -> float:
        """Position that the servo knows [ticks]: turns are lost in a restart."""
        return self.state.ticks + self.origin

    @property
    def origin(self) -> int:
        """Position that the servo knows where the motor is at zero [ticks]."""
        return self._shift - self._turns_lost * self.ticks_per_turn

    @property
    def torque(self) -> bool:
        """Whether the torque is on."""
        return bool(self["torque_enable"])

    @property
    def baud_rate(self) -> int:
        """Speed of the port [bit/s]."""
        return self.baud_rates[self["baud_rate"]]

    @baud_rate.setter
    def baud_rate(self, baud_rate: int) -> None:
        self["baud_rate"] = self.baud_rates.index(baud_rate)

    @property
    def return_delay(self) -> float:
        """Time between an instruction and its answer [s]."""
        return RETURN_DELAY_UNIT * self["return_delay"]

    @property
    def errors(self) -> tuple[str, ...]:
        """Names of the hardware errors."""
        bits = self["hardware_error"]
        return tuple(name for name, bit in self.error_bits.items() if bits & bit)

    @property
    def is_shut_down(self) -> bool:
        """Whether a hardware error keeps the torque off."""
        return bool(self["hardware_error"] & self._shutdown_bits)

    def obeys(self, id: int) -> bool:
        """Whether the servo does what it is told under an id, maybe without an answer."""
        return id == self.id

    @abstractmethod
    def set_up(self, current: float) -> None:
        """Store the settings of an arm in use: several turns, and a current limit [A]."""

    @property
    def watchdog_tripped(self) -> bool:
        """Whether the servo stopped because instructions stayed out."""
        return False

    @property
    def answers_reads(self) -> bool:
        """Whether the servo answers instructions that read."""
        return True

    @property
    def answers_writes(self) -> bool:
        """Whether the servo answers instructions that write."""
        return True

    @abstractmethod
    def command(self) -> MotorCommand:
        """Return what the servo demands of its motor."""

    @property
    @abstractmethod
    def _shutdown_bits(self) -> int:
        """Bits of the hardware errors that switch the torque off."""

    @property
    @abstractmethod
    def _present_offset(self) -> int:
        """Present position where the motor is at zero [ticks]."""

    @property
    def _present_position(self) -> int:
        return round(self.state.ticks) + self._present_offset

    def raise_error(self, name: str) -> None:
        """Set a hardware error: "overload", "overheating" or "voltage"."""
        self["hardware_error"] |= self.error_bits[name]
        if self.is_shut_down:
            self["torque_enable"] = 0

    def _measure(self) -> None:
        """Write the measurements into the registers."""
        self["present_position"] = self._present_position
        self["present_voltage"] = round(self.state.voltage / VOLTAGE_UNIT)
        self["present_temperature"] = round(self.temperature)

    @abstractmethod
    def _accept(self, register: EmulatedRegister, value: int) -> int | None:
        """Return the value that the servo stores instead, or None to ignore it.

        Raises:
            RefusalError: the servo refuses it.
        """

    @abstractmethod
    def _changed(self, register: EmulatedRegister) -> None:
        """React to a register that an instruction changed."""

    def is_present(self, now: float) -> bool:
        """Return whether the servo listens: it is powered and does not restart."""
        return now >= max(self.silent_until, self.gone_until)

    def hear(self, now: float) -> None:  # noqa: B027 - most servos have no watchdog
        """Note that an instruction, for whichever servo, arrived at a time [s]."""

    def read(self, address: int, size: int) -> bytes:
        """Return bytes of the control table.

        Raises:
            RefusalError: there are no such addresses.
        """
        if size < 1 or address + size > self.table.size:
            raise RefusalError(Reason.ACCESS)
        self._measure()
        return bytes(
            self.memory[self.resolve(part)] for part in range(address, address + size)
        )

    def write(self, address: int, data: bytes) -> None:
        """Change whole registers; all of them, or none.

        Raises:
            RefusalError: a value or an access is not allowed.
        """
        changes = self._split(address, data)
        accepted = [self._accept(register, value) for register, value in changes]
        for (register, _), value in zip(changes, accepted, strict=True):
            if value is not None:
                self._put(register, value)
                self._changed(register)

    def resolve(self, address: int) -> int:
        """Return the address that another address stands for."""
        return address

    def update(self, state: MotorState, seconds: float, now: float) -> None:
        """Take over measurements of the motor, and react to them.

        Args:
            state: of the motor.
            seconds: since the last update.
            now: time [s].
        """
        self.state = state
        # advance the thermal model: first order, heated by the square of current
        final = AMBIENT + _HEATING * self.state.current**2
        time = _THERMAL_TIME
        if self.overheats:
            final = _FAULT_AMBIENT
            time = _FAULT_THERMAL_TIME
        share = min(1.0, seconds / time)
        self.temperature += share * (final - self.temperature)
        overloaded = abs(state.current) >= self.overload_current
        self._overloaded_for = self._overloaded_for + seconds if overloaded else 0.0
        if self._overloaded_for > self.overload_time and self.torque:
            self.raise_error("overload")
        # raise the hardware errors that the measurements show
        if self.temperature > self["temperature_limit"]:
            self.raise_error("overheating")
        volts = round(self.state.voltage / VOLTAGE_UNIT)
        if not self["min_voltage"] <= volts <= self["max_voltage"]:
            self.raise_error("voltage")

    def restart(self, now: float) -> None:
        """Begin a restart: the servo is silent, and then as after power-up."""
        self._restart(now + RESTART_TIME)

    def forget_turns(self) -> None:
        """Take the position back into one turn."""
        self._turns_lost = int(self.state.ticks // self.ticks_per_turn)

    def shift_position(self, position: int) -> None:
        """Call the present position another one from now on [ticks]; goals follow."""
        shift = position - round(self.position)
        self._shift += shift
        self["goal_position"] += shift

    def _restart(self, silent_until: float) -> None:
        for register in self.table.registers:
            if not register.eeprom:
                self[register.name] = register.initial
        self.silent_until = silent_until
        self._overloaded_for = 0.0
        self.forget_turns()

    def _split(self, address: int, data: bytes) -> list[tuple[EmulatedRegister, int]]:
        """Return the registers that data cover, with their values."""
        targets = [self.resolve(address + offset) for offset in range(len(data))]
        changes = []
        offset = 0
        while offset < len(data):
            register = self.table.by_address.get(targets[offset])
            if register is None:
                inside = any(
                    other.address < targets[offset] < other.end
                    for other in self.table.registers
                )
                raise RefusalError(Reason.LENGTH if inside else Reason.ACCESS)
            covered = targets[offset : offset + register.size]
            if covered != list(range(register.address, register.end)):
                raise RefusalError(Reason.LENGTH)
            value = register.decode(data[offset : offset + register.size])
            changes.append((register, value))
            offset += register.size
        return changes
