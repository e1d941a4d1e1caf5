"""STS3215: control table and behavior, from its memory table (Feetech)."""

import math

from s2c2a.lab.emulation.registers import ControlTable, Register
from s2c2a.lab.emulation.servo import Drive, MotorCommand, MotorState, Servo

MODEL_NUMBER = 777
BAUD_RATES = (
    1_000_000,
    500_000,
    250_000,
    128_000,
    115_200,
    76_800,
    57_600,
    38_400,
)
TICKS_PER_TURN = 4096
RETURN_DELAY_UNIT = 2e-6  # s
CURRENT_UNIT = 6.5e-3  # A
VOLTAGE_UNIT = 0.1  # V
SPEED_UNIT = 2 * math.pi / TICKS_PER_TURN  # rad/s
NO_LOAD_SPEED = 4.7  # rad/s at 7.4 V
STALL_CURRENT = 2.4  # A; at the torque limit 1000
TORQUE_CONSTANT = 0.8  # N m/A
FULL_TORQUE = 1000

PHASE_FULL_ANGLE = 1 << 4
"""Bit of the phase: the present position counts several turns."""
POSITION_MODE = 0
WHEEL_MODE = 1
PWM_MODE = 2
STEP_MODE = 3
CALIBRATION = 128
"""Value of the torque register that calls the present position 2048."""
_MIDDLE = 2048
_SIGN = 15  # bit of positions, speeds and currents
_TURNS_LIMIT = 32_767  # ticks
_ERROR_BITS = {"voltage": 0x01, "encoder": 0x02, "overheating": 0x04}
_ERROR_BITS["overload"] = 0x20
_SHUTDOWN = _ERROR_BITS["overheating"] | _ERROR_BITS["overload"]


def _stored(name, address, size, initial, low, high) -> Register:
    return Register(name, address, size, True, True, initial, low, high)


def _volatile(name, address, size, initial, low, high, sign_bit=None) -> Register:
    return Register(
        name, address, size, True, False, initial, low, high, sign_bit=sign_bit
    )


def _measured(name, address, size, initial=0, sign_bit=None) -> Register:
    return Register(name, address, size, initial=initial, sign_bit=sign_bit)


def _constant(name, address, size, initial=0) -> Register:
    return Register(name, address, size, eeprom=True, initial=initial)


TABLE = ControlTable(
    (
        _constant("firmware", 0, 1, 3),
        _constant("firmware_minor", 1, 1, 10),
        _constant("model_number", 3, 2, MODEL_NUMBER),
        _stored("id", 5, 1, 1, 0, 253),
        _stored("baud_rate", 6, 1, 0, 0, 7),
        _stored("return_delay", 7, 1, 0, 0, 254),
        _stored("status_return_level", 8, 1, 1, 0, 1),
        _stored("min_position", 9, 2, 0, 0, 4094),
        _stored("max_position", 11, 2, 4095, 0, 4095),
        _stored("temperature_limit", 13, 1, 70, 0, 100),
        _stored("max_voltage", 14, 1, 80, 0, 254),
        _stored("min_voltage", 15, 1, 40, 0, 254),
        _stored("max_torque", 16, 2, 1000, 0, 1000),
        _stored("phase", 18, 1, 12, 0, 254),
        _stored("unloading", 19, 1, 44, 0, 254),
        _stored("led_alarm", 20, 1, 47, 0, 254),
        _stored("position_p_gain", 21, 1, 32, 0, 254),
        _stored("position_d_gain", 22, 1, 32, 0, 254),
        _stored("position_i_gain", 23, 1, 0, 0, 254),
        _stored("startup_force", 24, 2, 16, 0, 1000),
        _stored("dead_band_up", 26, 1, 1, 0, 32),
        _stored("dead_band_down", 27, 1, 1, 0, 32),
        _stored("protection_current", 28, 2, 500, 0, 511),
        _stored("angular_resolution", 30, 1, 1, 1, 3),
        Register("homing_offset", 31, 2, True, True, 0, -2047, 2047, (), 11),
        _stored("operating_mode", 33, 1, POSITION_MODE, 0, 3),
        _stored("protective_torque", 34, 1, 20, 0, 100),
        _stored("protection_time", 35, 1, 200, 0, 254),
        _stored("overload_torque", 36, 1, 80, 0, 100),
        _stored("speed_p_gain", 37, 1, 10, 0, 100),
        _stored("overcurrent_time", 38, 1, 200, 0, 254),
        _stored("speed_i_gain", 39, 1, 10, 0, 254),
        _volatile("torque_enable", 40, 1, 0, 0, CALIBRATION),
        _volatile("acceleration", 41, 1, 0, 0, 254),
        _volatile("goal_position", 42, 2, 0, -_TURNS_LIMIT, _TURNS_LIMIT, _SIGN),
        _volatile("goal_time", 44, 2, 0, -1000, 1000, 10),
        _volatile("goal_speed", 46, 2, 0, -_TURNS_LIMIT, _TURNS_LIMIT, _SIGN),
        _volatile("torque_limit", 48, 2, FULL_TORQUE, 0, FULL_TORQUE),
        _volatile("lock", 55, 1, 1, 0, 1),
        _measured("present_position", 56, 2, 0, _SIGN),
        _measured("present_speed", 58, 2, 0, _SIGN),
        _measured("present_load", 60, 2, 0, 10),
        _measured("present_voltage", 62, 1, 74),
        _measured("present_temperature", 63, 1, 25),
        _measured("registered_instruction", 64, 1),
        _measured("hardware_error", 65, 1),
        _measured("moving", 66, 1),
        _measured("present_current", 69, 2, 0, _SIGN),
    )
)
_STORED = [register for register in TABLE.registers if register.eeprom]


class STS3215(Servo):
    """An STS3215. It has no bus watchdog, and takes the nearest value that it can.

    While the lock is set, changes of EEPROM registers last until the next restart. The
    position counts several turns in position mode with both angle limits zero, and in
    step mode, in which goals are relative.
    """

    table = TABLE
    torque_constant = TORQUE_CONSTANT
    overload_current = 0.9 * STALL_CURRENT

    def __init__(self, id: int, state: MotorState):
        """Power the servo up; arguments as those of `Servo`."""
        self._stored: dict[str, int] = {}
        self._step_goal = 0
        super().__init__(id, state)
        self._store()

    @property
    def baud_rate(self) -> int:
        """See `Servo.baud_rate`."""
        return BAUD_RATES[self["baud_rate"]]

    @baud_rate.setter
    def baud_rate(self, baud_rate: int) -> None:
        self["baud_rate"] = BAUD_RATES.index(baud_rate)
        self._store()

    @property
    def return_delay(self) -> float:
        """See `Servo.return_delay`."""
        return RETURN_DELAY_UNIT * self["return_delay"]

    @property
    def errors(self) -> tuple[str, ...]:
        """See `Servo.errors`."""
        bits = self["hardware_error"]
        return tuple(name for name, bit in _ERROR_BITS.items() if bits & bit)

    @property
    def answers_writes(self) -> bool:
        """See `Servo.answers_writes`."""
        return self["status_return_level"] == 1

    def set_up(self, current: float) -> None:
        """See `Servo.set_up`."""
        self["min_position"] = 0
        self["max_position"] = 0
        self["phase"] |= PHASE_FULL_ANGLE
        limit = round(FULL_TORQUE * current / STALL_CURRENT)
        self["max_torque"] = min(limit, FULL_TORQUE)
        self._store()

    @property
    def counts_turns(self) -> bool:
        """Whether the position counts several turns."""
        if self["operating_mode"] == STEP_MODE:
            return True
        limits = self["min_position"], self["max_position"]
        return self["operating_mode"] == POSITION_MODE and limits == (0, 0)

    def command(self) -> MotorCommand:
        """See `Servo.command`."""
        share = min(self["torque_limit"], self["max_torque"]) / FULL_TORQUE
        current = STALL_CURRENT * share
        demanded = SPEED_UNIT * self["goal_speed"]
        if self["operating_mode"] in (WHEEL_MODE, PWM_MODE):
            return MotorCommand(
                self.torque, Drive.VELOCITY, demanded, NO_LOAD_SPEED, current
            )
        # Speed zero stands for the largest one.
        speed = min(NO_LOAD_SPEED, abs(demanded)) or NO_LOAD_SPEED
        goal = self["goal_position"]
        if self["operating_mode"] == STEP_MODE:
            goal = self._step_goal
        if not self.counts_turns:
            goal = min(max(goal, self["min_position"]), self["max_position"])
        goal -= self._present_offset
        return MotorCommand(self.torque, Drive.POSITION, goal, speed, current)

    def raise_error(self, name: str) -> None:
        """See `Servo.raise_error`; heat and overload switch the torque off."""
        self["hardware_error"] |= _ERROR_BITS[name]
        if self["hardware_error"] & _SHUTDOWN:
            self["torque_enable"] = 0

    @property
    def _present_offset(self) -> int:
        return self.origin - self["homing_offset"]

    @property
    def _present_position(self) -> int:
        position = round(self.state.ticks) + self._present_offset
        return position if self.counts_turns else position % TICKS_PER_TURN

    def _store(self) -> None:
        self._stored = {register.name: self[register.name] for register in _STORED}

    def _restart(self, silent_until: float) -> None:
        for name, value in self._stored.items():
            self[name] = value
        super()._restart(silent_until)
        self["goal_position"] = self._present_position

    def _accept(self, register: Register, value: int) -> int | None:
        """Ignore what is read-only, and take the nearest value that is possible."""
        if not register.writable:
            return None
        if register.name == "torque_enable" and self["hardware_error"] & _SHUTDOWN:
            return 0
        return min(max(value, register.low), register.high)

    def _changed(self, register: Register) -> None:
        if register.eeprom and not self["lock"]:
            self._stored[register.name] = self[register.name]
        if register.name == "operating_mode":
            self["goal_position"] = self._present_position
            self._step_goal = self._present_position
        if register.name == "goal_position":
            self._step_goal += self["goal_position"]
        if register.name == "torque_enable" and self["torque_enable"] == CALIBRATION:
            self["torque_enable"] = 0
            offset = self["homing_offset"] + self._present_position - _MIDDLE
            self["homing_offset"] = offset

    def _check_health(self) -> None:
        if self.temperature > self["temperature_limit"]:
            self.raise_error("overheating")
        volts = round(self.state.voltage / VOLTAGE_UNIT)
        if not self["min_voltage"] <= volts <= self["max_voltage"]:
            self.raise_error("voltage")

    def _measure(self) -> None:
        state = self.state
        speed = round(state.velocity / SPEED_UNIT)
        self["present_position"] = self._present_position
        self["present_speed"] = speed
        self["present_load"] = round(FULL_TORQUE * state.current / STALL_CURRENT)
        self["present_current"] = round(state.current / CURRENT_UNIT)
        self["present_voltage"] = round(state.voltage / VOLTAGE_UNIT)
        self["present_temperature"] = round(self.temperature)
        self["moving"] = int(abs(speed) > 1)
