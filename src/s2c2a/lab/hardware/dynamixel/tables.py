"""Control tables of DYNAMIXEL models, from the ROBOTIS e-manual.

Pages: emanual.robotis.com/docs/en/dxl/x/xl330-m288/ and those of the other models
(.../mx/mx-64-2/ for MX with protocol 2.0), each "Specifications", "Control Table" and
"Control Table Description". Another model is one more entry in `MODELS`, or a table
`[servos.own_model]` of an arm file.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

from s2c2a.arm.servos import OwnModel
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
        "secondary_id": Register(12, 1),
        "homing_offset": Register(20, 4, signed=True),
        "pwm_limit": Register(36, 2),
        "current_limit": Register(38, 2),
        # torque on and restored values at the start; zero where there is none
        "startup_configuration": Register(60, 1),
        "torque": Register(64, 1),
        "status_return_level": Register(68, 1),
        "hardware_error": Register(70, 1),
        "watchdog": Register(98, 1),
        "goal_pwm": Register(100, 2, signed=True),
        "goal_current": Register(102, 2, signed=True),
        "profile_acceleration": Register(108, 4),
        "profile_velocity": Register(112, 4),
        "goal_position": Register(116, 4, signed=True),
        # of models that measure no current: the load, estimated from the PWM
        "current": Register(126, 2, signed=True),
        "velocity": Register(128, 4, signed=True),
        "position": Register(132, 4, signed=True),
        "voltage": Register(144, 2),
        "temperature": Register(146, 1),
        "indirect_address": Register(168, 2),
        "measurements": Register(120, 27),
    }
)
"""Of the X series, and of MX with protocol 2.0; the names are ours. No two servos have
the same measurements, from the time to the temperature, so that the answers of two with
one id damage each other."""

BAUD_RATES = (
    9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000
)  # fmt: skip
"""By the number in the register `baud_rate`."""

CURRENT_LIMITED_POSITION = 5
"""Operating mode: positions over several turns, with a limited current."""
EXTENDED_POSITION = 4
"""Operating mode: positions over several turns; a limit of the PWM is its only one."""
FULL_PWM = 885
"""PWM of the whole supply voltage, in the unit of its registers."""
INDIRECT_DATA = 224
MAX_ID = 252
NO_SECONDARY_ID = 255
"""Each value above `MAX_ID` stands for none; this one is the factory's."""

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
        current_unit: of the registers of currents, or of the PWM at stall [A].
        max_current: largest current limit, or the current at stall [A].
        torque_constant: stall torque over stall current [N m/A].
        indirect_data: address of the first indirect value.
        moved_firmware: firmware from which that address is `moved_indirect_data`.
        moved_indirect_data: the later address.
        has_current: whether it measures and limits its current. If not, the limit of
            the PWM stands for one: at stall, the current is in proportion to it.
        addresses: of registers that differ from `REGISTERS`, by name.
    """

    name: str
    number: int
    current_unit: float
    max_current: float
    torque_constant: float
    indirect_data: int = INDIRECT_DATA
    moved_firmware: int = 256
    moved_indirect_data: int = INDIRECT_DATA
    has_current: bool = True
    addresses: Mapping[str, int] = field(default_factory=dict)

    @cached_property
    def registers(self) -> Mapping[str, Register]:
        """Registers by name."""
        own = {
            name: replace(REGISTERS[name], address=address)
            for name, address in self.addresses.items()
        }
        return {**REGISTERS, **own}

    @property
    def operating_mode(self) -> int:
        """Mode with positions over several turns and a limit."""
        return CURRENT_LIMITED_POSITION if self.has_current else EXTENDED_POSITION

    @property
    def limit_register(self) -> str:
        """Name of the limit in use."""
        return "goal_current" if self.has_current else "goal_pwm"

    @property
    def stored_limit_register(self) -> str:
        """Name of the limit that is kept without power."""
        return "current_limit" if self.has_current else "pwm_limit"

    def indirect_data_of(self, firmware: int) -> int:
        """Return the address of the first indirect value for a firmware."""
        moved = firmware >= self.moved_firmware
        return self.moved_indirect_data if moved else self.indirect_data


def without_current(
    name: str, number: int, stall_current: float, torque_constant: float
) -> DynamixelModel:
    """Return a model that measures no current.

    Args:
        name: in arm files.
        number: that a ping returns.
        stall_current: at the rated voltage [A].
        torque_constant: stall torque over stall current [N m/A].
    """
    unit = stall_current / FULL_PWM
    return DynamixelModel(
        name, number, unit, stall_current, torque_constant, has_current=False
    )


MODELS = MappingProxyType(
    {
        model.name: model
        for model in (
            # 0.52 N m at 1.47 A and 5 V; firmware 52 moved the indirect data
            DynamixelModel("xl330-m288", 1200, 0.001, 1.75, 0.354, 224, 52, 208),
            # 0.215 N m at 1.47 A and 5 V
            DynamixelModel("xl330-m077", 1190, 0.001, 1.75, 0.146, 224, 52, 208),
            # 0.92 N m at 0.80 A and 11.1 V, current of the supply
            DynamixelModel("xc330-t288", 1220, 0.001, 0.91, 1.15, 224, 52, 208),
            # 0.93 N m at 1.80 A and 5 V, current of the supply
            DynamixelModel("xc330-m288", 1240, 0.001, 2.352, 0.517, 224, 52, 208),
            # 1.5 N m at 1.4 A and 12 V
            without_current("xl430-w250", 1060, 1.4, 1.07),
            # 4.1 N m at 2.3 A and 12 V
            DynamixelModel("xm430-w350", 1020, 0.00269, 3.2, 1.78),
            # 10.6 N m at 4.4 A and 12 V
            DynamixelModel("xm540-w270", 1120, 0.00269, 5.5, 2.41),
            # 7.3 N m at 4.4 A and 12 V
            DynamixelModel("xm540-w150", 1130, 0.00269, 5.5, 1.66),
            # 2.5 N m at 1.4 A and 12 V
            without_current("mx-28", 30, 1.4, 1.79),
            # 6.0 N m at 4.1 A and 12 V
            DynamixelModel("mx-64", 311, 0.00336, 6.52, 1.46),
            # 8.4 N m at 5.2 A and 12 V
            DynamixelModel("mx-106", 321, 0.00336, 6.87, 1.62),
        )
    }
)


def model_of(name: str, own: OwnModel) -> DynamixelModel:
    """Return a model that an arm file describes.

    Args:
        name: in the arm file.
        own: its facts.
    """
    addresses = own.registers.model_dump(exclude_none=True)
    indirect_data = addresses.pop("indirect_data", INDIRECT_DATA)
    if own.current_unit is None:
        model = without_current(name, own.number, own.max_current, own.torque_constant)
    else:
        model = DynamixelModel(
            name, own.number, own.current_unit, own.max_current, own.torque_constant
        )
    return replace(model, indirect_data=indirect_data, addresses=addresses)
