"""Facts of Feetech STS servos: registers, error bits, baud rates, models.

Sources: the memory table of the magnetic-encoder STS series (Feetech, "STS servo memory
table analysis") for addresses, units and the bits of phase and status; the constants of
the vendor's package scservo_sdk for instructions and error bits; Feetech's data sheets
of the STS3215 for torques and currents. All values of two bytes are little-endian.
"""

from dataclasses import dataclass
from math import pi
from types import MappingProxyType

from s2c2a.lab.hardware.bus import HardwareError
from s2c2a.lab.hardware.packets import Register

KG_CM = 0.0980665
"""Torque of a kilogram-force at a centimeter [N m]."""


REGISTERS = MappingProxyType(
    {
        # firmware (major, minor), byte order, model (two bytes)
        "identity": Register(0, 5),
        # EPROM; written only while the lock is 0
        "id": Register(5),
        "baud_rate": Register(6),
        # all settings that `prepare` needs
        "settings": Register(7, 27),
        "return_delay": Register(7),
        "status_level": Register(8),  # 1: the servo answers every instruction
        "min_angle": Register(9, 2),  # both limits 0: several turns
        "max_angle": Register(11, 2),
        "max_torque": Register(16, 2),  # [0.1 % of the stall torque]
        "phase": Register(18),
        "mode": Register(33),  # 0: position
        # RAM
        "torque": Register(40),
        "acceleration": Register(41),  # 0: no ramp
        "goal_position": Register(42, 2, sign_bit=15),
        "goal_time": Register(44, 2),
        # limits, which a restart resets, and everything that a servo measures
        "state": Register(46, 25),
        "goal_speed": Register(46, 2, sign_bit=15),
        "torque_limit": Register(48, 2),  # [0.1 % of the stall torque]
        "lock": Register(55),
        "position": Register(56, 2, sign_bit=15),
        "speed": Register(58, 2, sign_bit=15),
        "load": Register(60, 2, sign_bit=10),  # [0.1 % of the supply], motor voltage
        "voltage": Register(62),  # [0.1 V]
        "temperature": Register(63),  # [deg C]
        "status": Register(65),
        "current": Register(69, 2, sign_bit=15),  # [6.5 mA]
    }
)
"""Of the STS series, with blocks of them; the names are ours."""

PHASE_FINE_SPEED = 1 << 2
"""Speeds in steps/s; in 50 steps/s without this bit."""
PHASE_FULL_ANGLE = 1 << 4
"""Present position over several turns; within one turn without this bit."""

TICKS_PER_TURN = 4096
MAX_SPEED = 32_767
FULL_TORQUE = 1000
TICK_SPEED = 2 * pi / TICKS_PER_TURN
"""Speed of one step/s [rad/s]."""
COARSE_SPEED_STEPS = 50
VOLTAGE_UNIT = 0.1  # [V]
CURRENT_UNIT = 0.0065  # [A]
MAX_ID = 252
"""Largest id that an arm file allows; 254 is the broadcast."""

BAUD_RATES = (
    1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400
)  # fmt: skip
"""By the number in the register `baud_rate`."""
ERROR_BITS = {
    1: HardwareError.VOLTAGE,
    2: HardwareError.ENCODER,
    4: HardwareError.OVERHEATED,
    8: HardwareError.OVERLOAD,  # too much current
    32: HardwareError.OVERLOAD,
}
"""Bits of the status register and of the error byte of an answer."""


@dataclass(frozen=True)
class FeetechModel:
    """Data of a model.

    Attributes:
        number: that the servo states.
        stall_torque: at the rated voltage [N m].
        max_current: stall current at the rated voltage [A].
    """

    number: int
    stall_torque: float
    max_current: float

    @property
    def torque_constant(self) -> float:
        """Torque per current [N m/A]."""
        return self.stall_torque / self.max_current

    @property
    def current_unit(self) -> float:
        """Current of a unit of the torque limits [A]."""
        return self.max_current / FULL_TORQUE


MODELS = {
    "sts3215": FeetechModel(777, 19.5 * KG_CM, 2.4),  # at 7.4 V
    "sts3215-12v": FeetechModel(777, 30.0 * KG_CM, 2.7),
}
MODEL_NAMES = {777: "sts3215"}
"""Names by number; the variants of a model state the same number."""
