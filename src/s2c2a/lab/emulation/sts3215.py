"""STS3215: control table and behavior, from its memory table (Feetech)."""

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
from s2c2a.lab.emulation.servo import MotorCommand, MotorState, Servo

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
CURRENT_UNIT = 6.5e-3  # A
SPEED_UNIT = 2 * math.pi / TICKS_PER_TURN  # rad/s
NO_LOAD_SPEED = 4.7  # rad/s at 7.4 V
STALL_CURRENT = 2.4  # A; at the torque limit 1000
TORQUE_CONSTANT = 0.8  # N m/A
FULL_TORQUE = 1000

PHASE_FULL_ANGLE = 1 << 4
"""Bit of the phase: the present position counts several turns."""
POSITION_MODE = 0
_SIGN = 15  # bit of positions, speeds and currents
_TURNS_LIMIT = 32_767  # ticks
TABLE = ControlTable(
    (
        constant("firmware", 0, 1, 3),
        constant("firmware_minor", 1, 1, 10),
        constant("model_number", 3, 2, MODEL_NUMBER),
        stored("id", 5, 1, 1, 0, 253),
        stored("baud_rate", 6, 1, 0, 0, 7),
        stored("return_delay", 7, 1, 0, 0, 254),
        stored("status_return_level", 8, 1, 1, 0, 1),
        stored("min_position", 9, 2, 0, 0, 4094),
        stored("max_position", 11, 2, 4095, 0, 4095),
        stored("temperature_limit", 13, 1, 70, 0, 100),
        stored("max_voltage", 14, 1, 80, 0, 254),
        stored("min_voltage", 15, 1, 40, 0, 254),
        stored("max_torque", 16, 2, 1000, 0, 1000),
        stored("phase", 18, 1, 12, 0, 254),
        stored("unloading", 19, 1, 44, 0, 254),
        stored("led_alarm", 20, 1, 47, 0, 254),
        stored("position_p_gain", 21, 1, 32, 0, 254),
        stored("position_d_gain", 22, 1, 32, 0, 254),
        stored("position_i_gain", 23, 1, 0, 0, 254),
        stored("startup_force", 24, 2, 16, 0, 1000),
        stored("dead_band_up", 26, 1, 1, 0, 32),
        stored("dead_band_down", 27, 1, 1, 0, 32),
        stored("protection_current", 28, 2, 500, 0, 511),
        stored("angular_resolution", 30, 1, 1, 1, 3),
        stored("homing_offset", 31, 2, 0, -2047, 2047, sign_bit=11),
        stored("operating_mode", 33, 1, POSITION_MODE, 0, 0),
        stored("protective_torque", 34, 1, 20, 0, 100),
        stored("protection_time", 35, 1, 200, 0, 254),
        stored("overload_torque", 36, 1, 80, 0, 100),
        stored("speed_p_gain", 37, 1, 10, 0, 100),
        stored("overcurrent_time", 38, 1, 200, 0, 254),
        stored("speed_i_gain", 39, 1, 10, 0, 254),
        volatile("torque_enable", 40, 1, 0, 0, 1),
        volatile("acceleration", 41, 1, 0, 0, 254),
        volatile(
            "goal_position", 42, 2, 0, -_TURNS_LIMIT, _TURNS_LIMIT, sign_bit=_SIGN
        ),
        volatile("goal_time", 44, 2, 0, -1000, 1000, sign_bit=10),
        volatile("goal_speed", 46, 2, 0, -_TURNS_LIMIT, _TURNS_LIMIT, sign_bit=_SIGN),
        volatile("torque_limit", 48, 2, FULL_TORQUE, 0, FULL_TORQUE),
        volatile("lock", 55, 1, 1, 0, 1),
        measured("present_position", 56, 2, 0, sign_bit=_SIGN),
        measured("present_speed", 58, 2, 0, sign_bit=_SIGN),
        measured("present_load", 60, 2, 0, sign_bit=10),
        measured("present_voltage", 62, 1, 74),
        measured("present_temperature", 63, 1, 25),
        measured("registered_instruction", 64, 1),
        measured("hardware_error", 65, 1),
        measured("moving", 66, 1),
        measured("present_current", 69, 2, 0, sign_bit=_SIGN),
    )
)


class STS3215(Servo):
    """An STS3215. It has no bus watchdog, and takes the nearest value that it can.

    While the lock is set, changes of EEPROM registers last until the next restart. The
    position counts several turns with both angle limits zero.
    """

    table = TABLE
    baud_rates = BAUD_RATES
    error_bits = MappingProxyType(
        {"voltage": 0x01, "encoder": 0x02, "overheating": 0x04, "overload": 0x20}
    )
    torque_constant = TORQUE_CONSTANT
    overload_current = 0.9 * STALL_CURRENT

    def __init__(self, id: int, state: MotorState, firmware: int = 0):
        """Power the servo up; arguments as those of `Servo`."""
        self._stored = {one: one.initial for one in TABLE.registers if one.eeprom}
        super().__init__(id, state)

    def __setitem__(self, name: str, value: int) -> None:
        """See `Servo`; what changes from inside is stored."""
        super().__setitem__(name, value)
        register = self.table.by_name[name]
        if register.eeprom:
            self._stored[register] = value

    @property
    def answers_writes(self) -> bool:
        return self["status_return_level"] == 1

    def set_up(self, current: float) -> None:
        self["min_position"] = 0
        self["max_position"] = 0
        self["phase"] |= PHASE_FULL_ANGLE
        limit = round(FULL_TORQUE * current / STALL_CURRENT)
        self["max_torque"] = min(limit, FULL_TORQUE)

    @property
    def counts_turns(self) -> bool:
        """Whether the position counts several turns."""
        return self["min_position"] == self["max_position"] == 0

    def command(self) -> MotorCommand:
        share = min(self["torque_limit"], self["max_torque"]) / FULL_TORQUE
        current = STALL_CURRENT * share
        demanded = SPEED_UNIT * self["goal_speed"]
        # Speed zero stands for the largest one.
        speed = min(NO_LOAD_SPEED, abs(demanded)) or NO_LOAD_SPEED
        goal = self["goal_position"]
        if not self.counts_turns:
            goal = min(max(goal, self["min_position"]), self["max_position"])
        goal -= self._present_offset
        return MotorCommand(self.torque, goal, speed, current)

    @property
    def _shutdown_bits(self) -> int:
        return self.error_bits["overheating"] | self.error_bits["overload"]

    @property
    def _present_offset(self) -> int:
        return self.origin - self["homing_offset"]

    @property
    def _present_position(self) -> int:
        position = super()._present_position
        return position if self.counts_turns else position % TICKS_PER_TURN

    def _restart(self, silent_until: float) -> None:
        for register, value in self._stored.items():
            self._put(register, value)
        super()._restart(silent_until)
        self["goal_position"] = self._present_position

    def _accept(self, register: EmulatedRegister, value: int) -> int | None:
        """Ignore what is read-only, and take the nearest value that is possible."""
        if not register.writable:
            return None
        if register.name == "torque_enable" and self.is_shut_down:
            return 0
        return min(max(value, register.low), register.high)

    def _changed(self, register: EmulatedRegister) -> None:
        if register.eeprom and not self["lock"]:
            self[register.name] = self[register.name]

    def _measure(self) -> None:
        super()._measure()
        state = self.state
        speed = round(state.velocity / SPEED_UNIT)
        self["present_speed"] = speed
        self["present_load"] = round(FULL_TORQUE * state.current / STALL_CURRENT)
        self["present_current"] = round(state.current / CURRENT_UNIT)
        self["moving"] = int(abs(speed) > 1)
