"""Facts of Feetech STS servos: registers, error bits, baud rates, models.

Sources: the memory table of the magnetic-encoder STS series (Feetech, "STS servo memory
table analysis") for addresses, units and the bits of phase and status; the constants of
the vendor's package scservo_sdk for instructions and error bits; Feetech's data sheets
of the STS3215 for torques and currents. All values of two bytes are little-endian.
"""

from dataclasses import dataclass
from math import pi

from s2c2a.lab.hardware.bus import HardwareError

KG_CM = 0.0980665
"""Torque of a kilogram-force at a centimeter [N m]."""


@dataclass(frozen=True)
class Register:
    """Address and encoding of a value.

    Attributes:
        address: of the lowest byte.
        size: [bytes].
        sign_bit: bit that makes the value negative (sign and magnitude); None if the
            value has no sign.
    """

    address: int
    size: int = 1
    sign_bit: int | None = None


# EPROM; written only while LOCK is 0
ID = Register(5)
BAUD_RATE = Register(6)
RETURN_DELAY = Register(7)
STATUS_LEVEL = Register(8)  # 1: the servo answers every instruction
MIN_ANGLE = Register(9, 2)  # both limits 0: several turns
MAX_ANGLE = Register(11, 2)
MAX_TORQUE = Register(16, 2)  # [0.1 % of the stall torque]
PHASE = Register(18)
MODE = Register(33)  # 0: position
# RAM
TORQUE_ENABLE = Register(40)
ACCELERATION = Register(41)  # 0: no ramp
GOAL_POSITION = Register(42, 2, sign_bit=15)
GOAL_TIME = Register(44, 2)
GOAL_SPEED = Register(46, 2, sign_bit=15)
TORQUE_LIMIT = Register(48, 2)  # [0.1 % of the stall torque]
LOCK = Register(55)
PRESENT_POSITION = Register(56, 2, sign_bit=15)
PRESENT_SPEED = Register(58, 2, sign_bit=15)
PRESENT_LOAD = Register(60, 2, sign_bit=10)  # [0.1 % of the supply], motor voltage
PRESENT_VOLTAGE = Register(62)  # [0.1 V]
PRESENT_TEMPERATURE = Register(63)  # [deg C]
STATUS = Register(65)
PRESENT_CURRENT = Register(69, 2, sign_bit=15)  # [6.5 mA]

IDENTITY_BLOCK = Register(0, 5)
"""Firmware (major, minor), byte order, model (two bytes)."""
SETTINGS_BLOCK = Register(RETURN_DELAY.address, MODE.address - RETURN_DELAY.address + 1)
"""All settings in EPROM that `prepare` needs."""
STATE_BLOCK = Register(GOAL_SPEED.address, 25)
"""Limits, which a restart resets, and everything that a servo measures."""

PHASE_FINE_SPEED = 1 << 2
"""Speeds in steps/s; in 50 steps/s without this bit."""
PHASE_FULL_ANGLE = 1 << 4
"""Present position over several turns; within one turn without this bit."""

TICKS_PER_TURN = 4096
MAX_POSITION = 32_767
MAX_SPEED = 32_767
FULL_TORQUE = 1000
TICK_SPEED = 2 * pi / TICKS_PER_TURN
"""Speed of one step/s [rad/s]."""
COARSE_SPEED_STEPS = 50
VOLTAGE_UNIT = 0.1  # [V]
CURRENT_UNIT = 0.0065  # [A]
MAX_ID = 252
"""Largest id that an arm file allows; 254 is the broadcast."""

BAUD_CODES = {
    1_000_000: 0,
    500_000: 1,
    250_000: 2,
    128_000: 3,
    115_200: 4,
    76_800: 5,
    57_600: 6,
    38_400: 7,
}
ERROR_BITS = {
    1: HardwareError.VOLTAGE,
    2: HardwareError.ENCODER,
    4: HardwareError.OVERHEATED,
    8: HardwareError.OVERLOAD,  # too much current
    32: HardwareError.OVERLOAD,
}
"""Bits of the status register and of the error byte of an answer."""


@dataclass(frozen=True)
class Model:
    """Data of a model.

    Attributes:
        number: that the servo states.
        stall_torque: at the rated voltage [N m].
        stall_current: at the rated voltage [A].
    """

    number: int
    stall_torque: float
    stall_current: float

    @property
    def torque_constant(self) -> float:
        """Torque per current [N m/A]."""
        return self.stall_torque / self.stall_current


MODELS = {
    "sts3215": Model(777, 19.5 * KG_CM, 2.4),  # at 7.4 V
    "sts3215-12v": Model(777, 30.0 * KG_CM, 2.7),
}
MODEL_NAMES = {777: "sts3215"}
"""Names by number; the variants of a model state the same number."""
