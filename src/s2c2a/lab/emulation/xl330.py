"""XL330-M288: control table and behavior, from its e-manual (ROBOTIS)."""

import math

from s2c2a.lab.emulation.registers import ControlTable, Register
from s2c2a.lab.emulation.servo import (
    Drive,
    MotorCommand,
    MotorState,
    Reason,
    RefusalError,
    Servo,
)

MODEL_NUMBER = 1200
BAUD_RATES = (9600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)
INDIRECT_ADDRESSES = 168
INDIRECT_COUNT = 20
RETURN_DELAY_UNIT = 2e-6  # s
VELOCITY_UNIT = 0.229 * 2 * math.pi / 60  # rad/s
CURRENT_UNIT = 1e-3  # A
VOLTAGE_UNIT = 0.1  # V
WATCHDOG_UNIT = 0.02  # s
NO_LOAD_SPEED = 10.8  # rad/s at 5 V
TORQUE_CONSTANT = 0.35  # N m/A
OVERLOAD_CURRENT = 1.3  # A
MOVING_FIRMWARE = 52
"""First firmware whose indirect data are at 208, no longer at 224."""

CURRENT_MODE = 0
VELOCITY_MODE = 1
POSITION_MODE = 3
EXTENDED_POSITION_MODE = 4
CURRENT_BASED_POSITION_MODE = 5
PWM_MODE = 16
_MODES = (
    CURRENT_MODE,
    VELOCITY_MODE,
    POSITION_MODE,
    EXTENDED_POSITION_MODE,
    CURRENT_BASED_POSITION_MODE,
    PWM_MODE,
)
_GOALS = frozenset(("goal_pwm", "goal_current", "goal_velocity", "goal_position"))
_LIMITS = {
    "goal_current": "current_limit",
    "goal_velocity": "velocity_limit",
    "goal_pwm": "pwm_limit",
}
_ERROR_BITS = {"voltage": 0x01, "overheating": 0x04, "encoder": 0x08, "shock": 0x10}
_ERROR_BITS["overload"] = 0x20
_TURNS_LIMIT = 1_048_575  # ticks
_TICKS = 32_768  # ms; after which the time starts again


def _stored(name, address, size, initial, low, high, values=()) -> Register:
    return Register(name, address, size, True, True, initial, low, high, values)


def _volatile(name, address, size, initial, low, high) -> Register:
    return Register(name, address, size, True, False, initial, low, high)


def _measured(name, address, size, initial=0, signed=False) -> Register:
    return Register(name, address, size, initial=initial, low=-1 if signed else 0)


def _constant(name, address, size, initial=0) -> Register:
    return Register(name, address, size, eeprom=True, initial=initial)


_REGISTERS = (
    _constant("model_number", 0, 2, MODEL_NUMBER),
    _constant("model_information", 2, 4),
    _constant("firmware", 6, 1, 52),
    _stored("id", 7, 1, 1, 0, 252),
    _stored("baud_rate", 8, 1, 1, 0, 6),
    _stored("return_delay", 9, 1, 250, 0, 254),
    _stored("drive_mode", 10, 1, 0, 0, 13),
    _stored("operating_mode", 11, 1, POSITION_MODE, 0, 16, _MODES),
    _stored("secondary_id", 12, 1, 255, 0, 255),
    _stored("protocol", 13, 1, 2, 2, 22, (2, 20, 21, 22)),
    _stored("homing_offset", 20, 4, 0, -1_044_479, 1_044_479),
    _stored("moving_threshold", 24, 4, 10, 0, 1023),
    _stored("temperature_limit", 31, 1, 70, 0, 100),
    _stored("max_voltage", 32, 2, 70, 31, 70),
    _stored("min_voltage", 34, 2, 35, 31, 70),
    _stored("pwm_limit", 36, 2, 885, 0, 885),
    _stored("current_limit", 38, 2, 1750, 0, 1750),
    _stored("velocity_limit", 44, 4, 445, 0, 2047),
    _stored("max_position", 48, 4, 4095, 0, 4095),
    _stored("min_position", 52, 4, 0, 0, 4095),
    _stored("startup", 60, 1, 0, 0, 3),
    _stored("pwm_slope", 62, 1, 140, 1, 255),
    _stored("shutdown", 63, 1, 0x35, 0, 255),
    _volatile("torque_enable", 64, 1, 0, 0, 1),
    _volatile("led", 65, 1, 0, 0, 1),
    _volatile("status_return_level", 68, 1, 2, 0, 2),
    _measured("registered_instruction", 69, 1),
    _measured("hardware_error", 70, 1),
    _volatile("velocity_i_gain", 76, 2, 1600, 0, 16_383),
    _volatile("velocity_p_gain", 78, 2, 180, 0, 16_383),
    _volatile("position_d_gain", 80, 2, 0, 0, 16_383),
    _volatile("position_i_gain", 82, 2, 0, 0, 16_383),
    _volatile("position_p_gain", 84, 2, 400, 0, 16_383),
    _volatile("feedforward_2nd_gain", 88, 2, 0, 0, 16_383),
    _volatile("feedforward_1st_gain", 90, 2, 0, 0, 16_383),
    _volatile("bus_watchdog", 98, 1, 0, -1, 127),
    _volatile("goal_pwm", 100, 2, 885, -885, 885),
    _volatile("goal_current", 102, 2, 1750, -1750, 1750),
    _volatile("goal_velocity", 104, 4, 0, -2047, 2047),
    _volatile("profile_acceleration", 108, 4, 0, 0, 32_767),
    _volatile("profile_velocity", 112, 4, 0, 0, 32_767),
    _volatile("goal_position", 116, 4, 0, -_TURNS_LIMIT, _TURNS_LIMIT),
    _measured("realtime_tick", 120, 2),
    _measured("moving", 122, 1),
    _measured("moving_status", 123, 1),
    _measured("present_pwm", 124, 2, signed=True),
    _measured("present_current", 126, 2, signed=True),
    _measured("present_velocity", 128, 4, signed=True),
    _measured("present_position", 132, 4, signed=True),
    _measured("velocity_trajectory", 136, 4, signed=True),
    _measured("position_trajectory", 140, 4, signed=True),
    _measured("present_voltage", 144, 2, 50),
    _measured("present_temperature", 146, 1, 25),
    _measured("backup_ready", 147, 1),
)


def indirect_data(firmware: int) -> int:
    """Return the first address of the indirect data of a firmware."""
    return 208 if firmware >= MOVING_FIRMWARE else 224


def make_table(firmware: int) -> ControlTable:
    """Return the control table of a firmware."""
    start = indirect_data(firmware)
    addresses = (
        _volatile(
            f"indirect_address_{number + 1}",
            INDIRECT_ADDRESSES + 2 * number,
            2,
            start + number,
            64,
            start + INDIRECT_COUNT - 1,
        )
        for number in range(INDIRECT_COUNT)
    )
    data = _volatile("indirect_data", start, INDIRECT_COUNT, 0, 0, 0)
    return ControlTable((*_REGISTERS, *addresses, data))


class XL330(Servo):
    """An XL330-M288 with a bus watchdog.

    While the torque is off, the goal position keeps what was last written: torque
    switched on again moves the motor there. Power-up, restart and another operating
    mode set it to the present position.
    """

    torque_constant = TORQUE_CONSTANT
    overload_current = OVERLOAD_CURRENT

    def __init__(self, id: int, state: MotorState, firmware: int = MOVING_FIRMWARE):
        """Power the servo up.

        Args:
            id: on the bus.
            state: of the motor.
            firmware: version.
        """
        self.table = make_table(firmware)
        self._indirect_start = indirect_data(firmware)
        self._heard = 0.0
        super().__init__(id, state)
        self["firmware"] = firmware

    @property
    def baud_rate(self) -> int:
        """See `Servo.baud_rate`."""
        return BAUD_RATES[self["baud_rate"]]

    @baud_rate.setter
    def baud_rate(self, baud_rate: int) -> None:
        self["baud_rate"] = BAUD_RATES.index(baud_rate)

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
    def watchdog_tripped(self) -> bool:
        """See `Servo.watchdog_tripped`."""
        return self["bus_watchdog"] == -1

    @property
    def answers_reads(self) -> bool:
        """See `Servo.answers_reads`."""
        return self["status_return_level"] >= 1

    @property
    def answers_writes(self) -> bool:
        """See `Servo.answers_writes`."""
        return self["status_return_level"] >= 2

    def set_up(self, current: float) -> None:
        """See `Servo.set_up`."""
        self["return_delay"] = 0
        self["operating_mode"] = CURRENT_BASED_POSITION_MODE
        limit = min(round(current / CURRENT_UNIT), self["current_limit"])
        self["current_limit"] = limit
        self._reset_goals()

    def hear(self, now: float) -> None:
        """See `Servo.hear`."""
        self._heard = now

    @property
    def _present_offset(self) -> int:
        """Present position where the motor is at zero [ticks]."""
        return self.origin + self["homing_offset"]

    @property
    def _present_position(self) -> int:
        return round(self.state.ticks) + self._present_offset

    def command(self) -> MotorCommand:
        """See `Servo.command`."""
        mode = self["operating_mode"]
        limit = CURRENT_UNIT * self["current_limit"]
        speed = min(NO_LOAD_SPEED, VELOCITY_UNIT * self["velocity_limit"])
        if mode == CURRENT_MODE:
            goal = CURRENT_UNIT * self["goal_current"]
            return MotorCommand(self.torque, Drive.CURRENT, goal, speed, abs(goal))
        if mode == VELOCITY_MODE:
            goal = VELOCITY_UNIT * self["goal_velocity"]
            return MotorCommand(self.torque, Drive.VELOCITY, goal, speed, limit)
        if mode == PWM_MODE:
            goal = NO_LOAD_SPEED * self["goal_pwm"] / 885
            return MotorCommand(self.torque, Drive.VELOCITY, goal, speed, limit)
        if mode == CURRENT_BASED_POSITION_MODE:
            limit = min(limit, CURRENT_UNIT * abs(self["goal_current"]))
        profile = VELOCITY_UNIT * self["profile_velocity"]
        speed = min(NO_LOAD_SPEED, profile) if profile else NO_LOAD_SPEED
        goal = self["goal_position"] - self._present_offset
        return MotorCommand(self.torque, Drive.POSITION, goal, speed, limit)

    def raise_error(self, name: str) -> None:
        """See `Servo.raise_error`; those in `shutdown` switch the torque off."""
        self["hardware_error"] |= _ERROR_BITS[name]
        if self["hardware_error"] & self["shutdown"]:
            self["torque_enable"] = 0

    def resolve(self, address: int) -> int:
        """See `Servo.resolve`: indirect data stand for other addresses."""
        number = address - self._indirect_start
        if not 0 <= number < INDIRECT_COUNT:
            return address
        pointer = INDIRECT_ADDRESSES + 2 * number
        return int.from_bytes(self.memory[pointer : pointer + 2], "little")

    def update(self, state: MotorState, seconds: float, now: float) -> None:
        """See `Servo.update`; the bus watchdog may stop the motor."""
        super().update(state, seconds, now)
        self["realtime_tick"] = int(1000 * now) % _TICKS
        period = WATCHDOG_UNIT * self["bus_watchdog"]
        if period > 0 and self.torque and now - self._heard > period:
            self["bus_watchdog"] = -1
            self["goal_velocity"] = 0
            self["goal_pwm"] = 0
            self["goal_position"] = self._present_position
            if self["operating_mode"] == CURRENT_MODE:
                self["goal_current"] = 0

    def _restart(self, silent_until: float) -> None:
        super()._restart(silent_until)
        self._reset_goals()

    def _reset_goals(self) -> None:
        self["goal_position"] = self._present_position
        self["goal_current"] = self["current_limit"]
        self["goal_pwm"] = self["pwm_limit"]
        self["goal_velocity"] = 0

    def _accept(self, register: Register, value: int) -> int:
        """Refuse what is locked, out of range or beyond a configured limit."""
        locked = register.eeprom and self.torque
        if locked or not register.writable:
            raise RefusalError(Reason.ACCESS)
        if not register.allows(value) or self._is_frozen(register, value):
            raise RefusalError(Reason.RANGE)
        if self._exceeds_limit(register.name, value):
            raise RefusalError(Reason.LIMIT)
        shut_down = self["hardware_error"] & self["shutdown"]
        if register.name == "torque_enable" and value and shut_down:
            raise RefusalError(Reason.FAILED)
        return value

    def _is_frozen(self, register: Register, value: int) -> bool:
        """Return whether the bus watchdog forbids a value."""
        if register.name == "bus_watchdog":
            return value < 0
        return register.name in _GOALS and self.watchdog_tripped

    def _exceeds_limit(self, name: str, value: int) -> bool:
        """Return whether a goal is beyond its configured limit."""
        if name in _LIMITS:
            return abs(value) > self[_LIMITS[name]]
        if name != "goal_position" or self["operating_mode"] != POSITION_MODE:
            return False
        return not self["min_position"] <= value <= self["max_position"]

    def _changed(self, register: Register) -> None:
        if register.name == "operating_mode":
            if self["operating_mode"] == POSITION_MODE:
                self.forget_turns()
            self._reset_goals()

    def _check_health(self) -> None:
        if self.temperature > self["temperature_limit"]:
            self.raise_error("overheating")
        volts = self.state.voltage / VOLTAGE_UNIT
        if not self["min_voltage"] <= round(volts) <= self["max_voltage"]:
            self.raise_error("voltage")

    def _measure(self) -> None:
        state = self.state
        velocity = round(state.velocity / VELOCITY_UNIT)
        position = self._present_position
        self["present_current"] = round(state.current / CURRENT_UNIT)
        self["present_velocity"] = velocity
        self["present_position"] = position
        self["velocity_trajectory"] = velocity
        self["position_trajectory"] = position
        self["present_voltage"] = round(state.voltage / VOLTAGE_UNIT)
        self["present_temperature"] = round(self.temperature)
        self["moving"] = int(abs(velocity) > self["moving_threshold"])
        self["present_pwm"] = round(885 * state.velocity / NO_LOAD_SPEED)
