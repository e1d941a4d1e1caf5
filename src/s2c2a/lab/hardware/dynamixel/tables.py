"""Control tables of DYNAMIXEL models, from the ROBOTIS e-manual.

Pages: emanual.robotis.com/docs/en/dxl/x/xl330-m288/, .../xl330-m077/ and
.../xm430-w350/, each "Control Table" and "Control Table Description". Another model of
the X series is one more entry in `MODELS`.
"""

import math
from dataclasses import dataclass
from types import MappingProxyType

from s2c2a.lab.hardware.packets import Register

REGISTERS = MappingProxyType(
    {
        "model_number": Register(0, 2),
        "firmware": Register(6, 1),
        "id": Register(7, 1),
        "baud_rate": Register(8, 1),
        "return_delay": Register(9, 1),
        "drive_mode": Register(10, 1),
        "operating_mode": Register(11, 1),
        "homing_offset": Register(20, 4, signed=True),
        "current_limit": Register(38, 2),
        "torque": Register(64, 1),
        "status_return_level": Register(68, 1),
        "hardware_error": Register(70, 1),
        "watchdog": Register(98, 1),
        "goal_current": Register(102, 2, signed=True),
        "profile_acceleration": Register(108, 4),
        "profile_velocity": Register(112, 4),
        "goal_position": Register(116, 4, signed=True),
        "current": Register(126, 2, signed=True),
        "velocity": Register(128, 4, signed=True),
        "position": Register(132, 4, signed=True),
        "voltage": Register(144, 2),
        "temperature": Register(146, 1),
        "indirect_address": Register(168, 2),
        "measurements": Register(120, 27),
    }
)
"""Of the X series; the names are ours. No two servos have the same measurements, from the
time to the temperature, so that the answers of two with one id damage each other."""

BAUD_RATES = (
    9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000
)  # fmt: skip
"""By the number in the register `baud_rate`."""

CURRENT_LIMITED_POSITION = 5
"""Operating mode: positions over several turns, with a limited current."""

VOLTAGE_UNIT = 0.1  # V
VELOCITY_UNIT = 0.229 * 2 * math.pi / 60  # rad/s
WATCHDOG_UNIT = 0.02  # s
WATCHDOG_TRIPPED = 255
MAX_WATCHDOG = 127
MAX_POSITION = 1_048_575  # ticks, over several turns
INDIRECT_COUNT = 20
HARDWARE_ERROR_BITS = MappingProxyType(
    {0: "VOLTAGE", 2: "OVERHEATED", 3: "ENCODER", 4: "SHOCK", 5: "OVERLOAD"}
)
"""Names in `bus.HardwareError`, by bit of the register."""


@dataclass(frozen=True)
class DynamixelModel:
    """What differs between models.

    Attributes:
        name: in arm files.
        number: that a ping returns.
        current_unit: of the registers of currents [A].
        max_current: largest current limit [A].
        torque_constant: stall torque over stall current [N m/A].
        indirect_data: address of the first indirect value.
        moved_firmware: firmware from which that address is `moved_indirect_data`.
        moved_indirect_data: the later address.
    """

    name: str
    number: int
    current_unit: float
    max_current: float
    torque_constant: float
    indirect_data: int = 224
    moved_firmware: int = 256
    moved_indirect_data: int = 224

    def indirect_data_of(self, firmware: int) -> int:
        """Return the address of the first indirect value for a firmware."""
        moved = firmware >= self.moved_firmware
        return self.moved_indirect_data if moved else self.indirect_data


MODELS = MappingProxyType(
    {
        model.name: model
        for model in (
            # 0.52 N m at 1.47 A and 5 V; firmware 52 moved the indirect data
            DynamixelModel("xl330-m288", 1200, 0.001, 1.75, 0.354, 224, 52, 208),
            # 0.215 N m at 1.47 A and 5 V
            DynamixelModel("xl330-m077", 1190, 0.001, 1.75, 0.146, 224, 52, 208),
            # 4.1 N m at 2.3 A and 12 V
            DynamixelModel("xm430-w350", 1020, 0.00269, 3.2, 1.78),
        )
    }
)
