"""XL330-M288: control table and behavior, from its e-manual (ROBOTIS)."""

import math
from types import MappingProxyType

from s2c2a.lab.emulation.registers import (
    ControlTable,
    EmulatedRegister,
    constant,
    measured,
    stored,
    volatile,
)
from s2c2a.lab.emulation.servo import (
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
VELOCITY_UNIT = 0.229 * 2 * math.pi / 60  # rad/s
CURRENT_UNIT = 1e-3  # A
WATCHDOG_UNIT = 0.02  # s
NO_LOAD_SPEED = 10.8  # rad/s at 5 V
TORQUE_CONSTANT = 0.35  # N m/A
OVERLOAD_CURRENT = 1.3  # A
STALL_CURRENT = 1.47  # A at 5 V
FULL_PWM = 885
WITHOUT_CURRENT = (1060, 30)
"""Numbers of models (XL430, MX-28) that have no mode with a limited current."""
MOVING_FIRMWARE = 52
"""First firmware whose indirect data are at 208, no longer at 224."""
MOVING_MODELS = (1190, 1200, 1220, 1240)
"""Numbers of the models (XL330, XC330) with such a firmware."""

POSITION_MODE = 3
EXTENDED_POSITION_MODE = 4
CURRENT_BASED_POSITION_MODE = 5
_MODES = (POSITION_MODE, EXTENDED_POSITION_MODE, CURRENT_BASED_POSITION_MODE)
TORQUE_AT_START = 1
"""Bit of the register `startup`."""
_TURNS_LIMIT = 1_048_575  # ticks
_TICKS = 32_768  # ms; after which the time starts again


_REGISTERS = (
    constant("model_number", 0, 2, MODEL_NUMBER),
    constant("model_information", 2, 4),
    constant("firmware", 6, 1, 52),
    stored("id", 7, 1, 1, 0, 252),
    stored("baud_rate", 8, 1, 1, 0, 6),
    stored("return_delay", 9, 1, 250, 0, 254),
    stored("drive_mode", 10, 1, 0, 0, 13),
    stored("operating_mode", 11, 1, POSITION_MODE, 0, 16, _MODES),
    stored("secondary_id", 12, 1, 255, 0, 255),
    stored("protocol", 13, 1, 2, 2, 22, (2, 20, 21, 22)),
    stored("homing_offset", 20, 4, 0, -1_044_479, 1_044_479),
    stored("moving_threshold", 24, 4, 10, 0, 1023),
    stored("temperature_limit", 31, 1, 70, 0, 100),
    stored("max_voltage", 32, 2, 70, 31, 70),
    stored("min_voltage", 34, 2, 35, 31, 70),
    stored("pwm_limit", 36, 2, FULL_PWM, 0, FULL_PWM),
    stored("current_limit", 38, 2, 1750, 0, 1750),
    stored("max_position", 48, 4, 4095, 0, 4095),
    stored("min_position", 52, 4, 0, 0, 4095),
    stored("startup", 60, 1, 0, 0, 3),
    stored("shutdown", 63, 1, 0x35, 0, 255),
    volatile("torque_enable", 64, 1, 0, 0, 1),
    volatile("led", 65, 1, 0, 0, 1),
    volatile("status_return_level", 68, 1, 2, 0, 2),
    measured("registered_instruction", 69, 1),
    measured("hardware_error", 70, 1),
    volatile("position_d_gain", 80, 2, 0, 0, 16_383),
    volatile("position_i_gain", 82, 2, 0, 0, 16_383),
    volatile("position_p_gain", 84, 2, 400, 0, 16_383),
    volatile("feedforward_2nd_gain", 88, 2, 0, 0, 16_383),
    volatile("feedforward_1st_gain", 90, 2, 0, 0, 16_383),
    volatile("bus_watchdog", 98, 1, 0, -1, 127),
    volatile("goal_pwm", 100, 2, FULL_PWM, -FULL_PWM, FULL_PWM),
    volatile("goal_current", 102, 2, 1750, -1750, 1750),
    volatile("profile_acceleration", 108, 4, 0, 0, 32_767),
    volatile("profile_velocity", 112, 4, 0, 0, 32_767),
    volatile("goal_position", 116, 4, 0, -_TURNS_LIMIT, _TURNS_LIMIT),
    measured("realtime_tick", 120, 2),
    measured("moving", 122, 1),
    measured("moving_status", 123, 1),
    measured("present_current", 126, 2, low=-1),
    measured("present_velocity", 128, 4, low=-1),
    measured("present_position", 132, 4, low=-1),
    measured("velocity_trajectory", 136, 4, low=-1),
    measured("position_trajectory", 140, 4, low=-1),
    measured("present_voltage", 144, 2, 50),
    measured("present_temperature", 146, 1, 25),
    measured("backup_ready", 147, 1),
)


def firmware_of(model_number: int, firmware: int) -> int:
    """Return a firmware whose indirect data are where those of a model are."""
    has_moved = model_number in MOVING_MODELS
    return firmware if has_moved else min(firmware, MOVING_FIRMWARE - 1)


def indirect_data(firmware: int) -> int:
    """Return the first address of the indirect data of a firmware."""
    return 208 if firmware >= MOVING_FIRMWARE else 224


def make_table(firmware: int) -> ControlTable:
    """Return the control table of a firmware."""
    start = indirect_data(firmware)
    addresses = (
        volatile(
            f"indirect_address_{number + 1}",
            INDIRECT_ADDRESSES + 2 * number,
            2,
            start + number,
            64,
            start + INDIRECT_COUNT - 1,
        )
        for number in range(INDIRECT_COUNT)
    )
    data = volatile("indirect_data", start, INDIRECT_COUNT, 0, 0, 0)
    return ControlTable((*_REGISTERS, *addresses, data))


class XL330(Servo):
    """An XL330-M288 with a bus watchdog.

    While the torque is off, the goal position keeps what was last written: torque
    switched on again moves the motor there. Power-up, restart and another operating
    mode set it to the present position.
    """

    baud_rates = BAUD_RATES
    error_bits = MappingProxyType(
        {
            "voltage": 0x01,
            "overheating": 0x04,
            "encoder": 0x08,
            "shock": 0x10,
            "overload": 0x20,
        }
    )
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
    def watchdog_tripped(self) -> bool:
        return self["bus_watchdog"] == -1

    @property
    def answers_reads(self) -> bool:
        return self["status_return_level"] >= 1

    @property
    def answers_writes(self) -> bool:
        return self["status_return_level"] >= 2

    def obeys(self, id: int) -> bool:
        return id in (self.id, self["secondary_id"])

    def set_up(self, current: float) -> None:
        self["return_delay"] = 0
        has_current = self["model_number"] not in WITHOUT_CURRENT
        mode = CURRENT_BASED_POSITION_MODE if has_current else EXTENDED_POSITION_MODE
        self["operating_mode"] = mode
        limit = min(round(current / CURRENT_UNIT), self["current_limit"])
        self["current_limit"] = limit
        self._reset_goals()

    def hear(self, now: float) -> None:
        self._heard = now

    @property
    def _present_offset(self) -> int:
        """Present position where the motor is at zero [ticks]."""
        return self.origin + self["homing_offset"]

    @property
    def _shutdown_bits(self) -> int:
        return self["shutdown"]

    def command(self) -> MotorCommand:
        limit = CURRENT_UNIT * self["current_limit"]
        if self["operating_mode"] == CURRENT_BASED_POSITION_MODE:
            limit = min(limit, CURRENT_UNIT * abs(self["goal_current"]))
        if abs(self["goal_pwm"]) < FULL_PWM:
            # at stall, the current is in proportion to the voltage
            limit = min(limit, STALL_CURRENT * abs(self["goal_pwm"]) / FULL_PWM)
        profile = VELOCITY_UNIT * self["profile_velocity"]
        speed = min(NO_LOAD_SPEED, profile) if profile else NO_LOAD_SPEED
        goal = self["goal_position"] - self._present_offset
        return MotorCommand(self.torque, goal, speed, limit)

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
            self["goal_position"] = self._present_position

    def _restart(self, silent_until: float) -> None:
        super()._restart(silent_until)
        self._reset_goals()
        self["torque_enable"] = self["startup"] & TORQUE_AT_START

    def _reset_goals(self) -> None:
        self["goal_position"] = self._present_position
        self["goal_current"] = self["current_limit"]
        self["goal_pwm"] = self["pwm_limit"]

    def _accept(self, register: EmulatedRegister, value: int) -> int:
        """Refuse what is locked, out of range or beyond a configured limit."""
        locked = register.eeprom and self.torque
        if locked or not register.writable:
            raise RefusalError(Reason.ACCESS)
        if not register.allows(value) or self._is_frozen(register, value):
            raise RefusalError(Reason.RANGE)
        if self._exceeds_limit(register.name, value):
            raise RefusalError(Reason.LIMIT)
        if register.name == "torque_enable" and value and self.is_shut_down:
            raise RefusalError(Reason.FAILED)
        return value

    def _is_frozen(self, register: EmulatedRegister, value: int) -> bool:
        """Return whether the bus watchdog forbids a value."""
        if register.name == "bus_watchdog":
            return value < 0
        return (
            register.name in ("goal_current", "goal_position") and self.watchdog_tripped
        )

    def _exceeds_limit(self, name: str, value: int) -> bool:
        """Return whether a goal is beyond its configured limit."""
        if name == "goal_current":
            return abs(value) > self["current_limit"]
        if name == "goal_pwm":
            return abs(value) > self["pwm_limit"]
        if name != "goal_position" or self["operating_mode"] != POSITION_MODE:
            return False
        return not self["min_position"] <= value <= self["max_position"]

    def _changed(self, register: EmulatedRegister) -> None:
        if register.name == "operating_mode":
            if self["operating_mode"] == POSITION_MODE:
                self.forget_turns()
            self._reset_goals()

    def _measure(self) -> None:
        super()._measure()
        velocity = round(self.state.velocity / VELOCITY_UNIT)
        self["present_current"] = round(self.state.current / CURRENT_UNIT)
        self["present_velocity"] = velocity
        self["velocity_trajectory"] = velocity
        self["position_trajectory"] = self._present_position
        self["moving"] = int(abs(velocity) > self["moving_threshold"])
