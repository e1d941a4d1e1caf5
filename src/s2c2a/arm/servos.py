"""Servos that wind the cables of a real arm, and the limits that they obey."""

import itertools
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import BaseModel, Field, model_validator

from s2c2a.arm.fields import LENGTH, LOST_MOTION, Frozen, Number, between, optional

if TYPE_CHECKING:
    from s2c2a.arm.spec import ArmSpec

MAX_SERVO_ID = 252  # of Dynamixel's protocol 2.0; the higher numbers address no servo
MODEL_NUMBERS = {
    "dynamixel": {
        "xl330-m288": 1200,
        "xl330-m077": 1190,
        "xc330-t288": 1220,
        "xc330-m288": 1240,
        "xl430-w250": 1060,
        "xm430-w350": 1020,
        "xm540-w270": 1120,
        "xm540-w150": 1130,
        "mx-28": 30,
        "mx-64": 311,
        "mx-106": 321,
    },
    "feetech": {"sts3215": 777, "sts3215-12v": 777},
}
"""Known models by protocol, with the number that they state on the bus; the first one
is the default. The packages of the protocols hold their other data."""
TurningDirection = Literal[-1, 1]
ServoId = Annotated[int, Field(ge=0, le=MAX_SERVO_ID)]
ModelNumber = Annotated[int, Field(ge=1, le=65_535)]  # two bytes
Address = Annotated[int, Field(ge=0, le=1023)]  # the X series ends at 661
Current = Annotated[Number, Field(ge=0.0001, le=20)]  # A
BaudRate = Annotated[int, Field(ge=9600, le=4_500_000)]
TorqueConstant = Annotated[Number, Field(ge=0.001, le=20)]  # N m/A
MODEL_NAME = r"^[a-z0-9][a-z0-9-]{0,31}$"
WAY_OUT = "or describe the model in a table [servos.own_model] of the arm file"


class ServoLimits(Frozen):
    """Limits of every servo; exceeding one is a fault, except of displacement.

    The defaults suit ROBOTIS XL330-M288 at 5 V (e-manual: 3.7 to 6.0 V, 70 deg C, 104
    turns a minute, which are 0.11 m/s at the default pulley).
    """

    displacement: Number | None = LENGTH.key(
        "largest displacement from rest; default: the range of the modules' cables",
        None,
    )
    speed: Number = between(0.001, 5, "m/s", "largest speed of a cable", 0.1)
    current: Number = between(
        0.01, 20, "A", "largest current, which limits the cable tension", 0.6
    )
    temperature: Number = between(30, 100, "deg C", "largest temperature", 65.0)
    low_voltage: Number = between(3, 48, "V", "smallest supply voltage", 4.0)
    high_voltage: Number = between(3, 60, "V", "largest supply voltage", 6.0)

    @model_validator(mode="after")
    def _validate(self):
        if self.low_voltage >= self.high_voltage:
            raise ValueError(
                f"low_voltage {self.low_voltage} V is not below high_voltage "
                f"{self.high_voltage} V; swap or correct them"
            )
        return self


def _address(meaning: str) -> Any:
    return Field(default=None, description=f"address of {meaning}; default: as XM430")


class OwnRegisters(Frozen):
    """Registers of a DYNAMIXEL model whose addresses are not those of the XM430."""

    drive_mode: Address | None = _address("the drive mode")
    operating_mode: Address | None = _address("the operating mode")
    homing_offset: Address | None = _address("the homing offset")
    pwm_limit: Address | None = _address("the stored limit of the PWM")
    current_limit: Address | None = _address("the stored limit of the current")
    torque: Address | None = _address("the switch of the torque")
    status_return_level: Address | None = _address("the status return level")
    hardware_error: Address | None = _address("the hardware error status")
    watchdog: Address | None = _address("the bus watchdog")
    goal_pwm: Address | None = _address("the limit of the PWM")
    goal_current: Address | None = _address("the limit of the current")
    profile_acceleration: Address | None = _address("the profile acceleration")
    profile_velocity: Address | None = _address("the profile velocity")
    goal_position: Address | None = _address("the goal position")
    measurements: Address | None = _address("the first of 27 bytes of measurements")
    current: Address | None = _address("the present current")
    velocity: Address | None = _address("the present velocity")
    position: Address | None = _address("the present position")
    voltage: Address | None = _address("the present input voltage")
    temperature: Address | None = _address("the present temperature")
    indirect_address: Address | None = _address("indirect address 1")
    indirect_data: Address | None = _address("indirect data 1")


class OwnModel(Frozen):
    """A DYNAMIXEL model with protocol 2.0 that the package does not know.

    Sizes and units of its registers are those of the X series, with 4096 ticks a turn.
    """

    number: ModelNumber = Field(description="number that the servos state")
    max_current: Current = Field(
        description="largest current limit; at stall, if they measure no current [A]"
    )
    torque_constant: TorqueConstant = Field(
        description="stall torque over stall current [N m/A]"
    )
    current_unit: Current | None = optional(
        "unit of currents [A]; default: the servos measure no current"
    )
    registers: OwnRegisters = OwnRegisters()


class ServoGroup(Frozen):
    """Servos that differ from the others of an arm: on another port, or another model.

    Keys that are left out are those of `[servos]`. A group with a model of its own does
    not take over `own_model` and `torque_constant`.
    """

    ids: tuple[ServoId, ...] = Field(
        description="these servos, of servos.ids; ids differ on all ports",
        json_schema_extra={"allowed": "whole numbers, 0 to 252"},
    )
    model: str | None = optional("model of the servos", pattern=MODEL_NAME)
    own_model: OwnModel | None = optional("facts of a model with another name")
    port: str | None = optional("serial port")
    baud_rate: BaudRate | None = optional("speed of that port [bit/s]")
    torque_constant: TorqueConstant | None = optional("torque per current [N m/A]")
    home_current: Current | None = optional(
        "current that takes up the slack of a cable [A]"
    )
    limits: ServoLimits | None = optional(
        "limits; keys left out are those of `[servos.limits]`"
    )


class Servos(Frozen):
    """Bus servos with one pulley for each cable.

    The pulley's radius and the ticks of a turn are keys of `[motor]`. The default baud
    rate is the fastest that both protocols' default models share; the home current is a
    tenth of the default limit, and the watchdog four default control periods.
    """

    omitted_defaults: ClassVar[frozenset[str]] = frozenset(
        ("limits", "own_model", "groups")
    )

    protocol: Literal["dynamixel", "feetech"] = optional(
        "protocol of the bus", "dynamixel"
    )
    model: str = optional(
        f"model of the servos; dynamixel: {', '.join(MODEL_NUMBERS['dynamixel'])}; "
        "feetech: sts3215 (default), sts3215-12v",
        "xl330-m288",
        pattern=MODEL_NAME,
    )
    own_model: OwnModel | None = optional("facts of a model with another name")
    port: str = optional(
        "serial port, such as /dev/ttyUSB0; empty: an option names it", ""
    )
    baud_rate: BaudRate = optional("speed of the bus [bit/s]", 1_000_000)
    ids: tuple[tuple[ServoId, ...], ...] = Field(
        description="servo of every cable, one row a module",
        json_schema_extra={"allowed": "rows of whole numbers, 0 to 252"},
    )
    directions: tuple[tuple[TurningDirection, ...], ...] | None = optional(
        "1 where a growing servo position pays the cable out, -1 where it winds "
        "it in, one row a module; default: all 1",
        json_schema_extra={"allowed": "rows of 1 and -1"},
    )
    torque_constant: Number | None = between(
        0.001, 20, "N m/A", "torque per current; default: of the model", None
    )
    layer_growth: Number = LOST_MOTION.effect(
        "growth of the pulley's radius with every turn wound on"
    )
    home_current: Number = between(
        0.005, 5, "A", "current that takes up the slack of a cable", 0.06
    )
    watchdog: Number = between(
        0.04, 2.5, "s", "time without a command after which a servo stops", 0.4
    )
    on_exit: Literal["hold", "release"] = optional(
        "torque after the arm is closed at rest", "release"
    )
    on_emergency: Literal["hold", "release"] = optional(
        "torque after an emergency stop", "release"
    )
    limits: ServoLimits = ServoLimits()
    groups: tuple[ServoGroup, ...] = optional("servos that differ from the others", ())

    @model_validator(mode="before")
    @classmethod
    def _complete_limits(cls, values: Any) -> Any:
        """Limits that a group leaves out are those of the others."""
        if not isinstance(values, dict) or not isinstance(values.get("groups"), list):
            return values
        common = values.get("limits")
        if not isinstance(common, dict):
            return values
        groups = [
            {**group, "limits": {**common, **group["limits"]}}
            if isinstance(group, dict) and isinstance(group.get("limits"), dict)
            else group
            for group in values["groups"]
        ]
        return {**values, "groups": groups}

    @model_validator(mode="before")
    @classmethod
    def _default_model(cls, values: Any) -> Any:
        """Without a model, the first of the protocol."""
        if not isinstance(values, dict) or "model" in values:
            return values
        known = MODEL_NUMBERS.get(str(values.get("protocol")))
        return values if known is None else {**values, "model": next(iter(known))}

    @model_validator(mode="after")
    def _validate(self):
        self._check_model()
        numbers = [number for row in self.ids for number in row]
        repeated = sorted({number for number in numbers if numbers.count(number) > 1})
        if repeated:
            raise ValueError(
                f"servos.ids names {repeated} twice; give every cable its own servo"
            )
        if self.directions is not None:
            given = [len(row) for row in self.directions]
            needed = [len(row) for row in self.ids]
            if given != needed:
                raise ValueError(
                    f"servos.directions has rows of lengths {given}; "
                    f"servos.ids has {needed}; give one direction for each servo"
                )
        self._check_home_current()
        named = [id for group in self.groups for id in group.ids]
        wrong = sorted({id for id in named if id not in numbers or named.count(id) > 1})
        if wrong or not all(group.ids for group in self.groups):
            raise ValueError(
                f"servos.groups names {wrong}, not in servos.ids or twice; name each "
                "servo of servos.ids in one group at most"
            )
        rates: dict[str, int] = {}
        for part, ids in self.parts():
            part._check_model()
            part._check_home_current()
            if rates.setdefault(part.port, part.baud_rate) != part.baud_rate:
                raise ValueError(
                    f"servos {ids} have another baud_rate than others on the port "
                    f"'{part.port}'; a port has one speed: give the same"
                )
            if part.limits.displacement != self.limits.displacement:
                raise ValueError(
                    "limits.displacement is one for the whole arm; write it in "
                    "[servos.limits] only"
                )
        return self

    def _check_model(self):
        known = MODEL_NUMBERS[self.protocol]
        names = ", ".join(known)
        if self.own_model is not None:
            if self.protocol != "dynamixel" or self.model in known:
                raise ValueError(
                    "servos.own_model describes a model of the protocol 'dynamixel' "
                    f"with a servos.model other than {names}; choose another name, or "
                    "leave the table out"
                )
        elif self.model not in known:
            raise ValueError(
                f"servos.model '{self.model}' is no known model with the protocol "
                f"'{self.protocol}'; choose one of {names}, {WAY_OUT}"
            )

    def _check_home_current(self):
        if self.home_current >= self.limits.current:
            raise ValueError(
                f"servos.home_current {self.home_current} A is not below "
                f"servos.limits.current {self.limits.current} A; lower it"
            )

    def parts(self) -> list[tuple["Servos", list[int]]]:
        """Return tables without groups, with their ids: of the rest, then each group."""
        named = {id for group in self.groups for id in group.ids}
        rest = tuple(id for row in self.ids for id in row if id not in named)
        groups = [ServoGroup(ids=rest), *self.groups][not rest :]
        return [(self._with(group), list(group.ids)) for group in groups]

    def of(self, id: int) -> "Servos":
        """Return the table that holds for a servo."""
        for group in self.groups:
            if id in group.ids:
                return self._with(group)
        return self

    def _with(self, group: ServoGroup) -> "Servos":
        update = {key: value for key, value in group if value is not None}
        del update["ids"]
        if group.model is not None:
            update = {"own_model": None, "torque_constant": None, **update}
        # not checked again: the whole table checks its parts
        return BaseModel.model_copy(self, update={"groups": (), **update})

    @property
    def model_number(self) -> int:
        """Number that the servos state."""
        if self.own_model is not None:
            return self.own_model.number
        return MODEL_NUMBERS[self.protocol][self.model]

    def number_of(self, id: int) -> str:
        """Return the place of a servo for users, such as "module 2, cable 1"."""
        for module, row in enumerate(self.ids, 1):
            if id in row:
                return f"module {module}, cable {row.index(id) + 1}"
        return "no cable"


def servos_of(arm: "ArmSpec") -> Servos:
    """Return the servos of an arm; without the table, ids from 1 row by row."""
    if arm.servos is not None:
        return arm.servos
    numbers = itertools.count(1)
    ids = [[next(numbers) for _ in module.cable_angles_deg] for module in arm.modules]
    return Servos.model_validate({"ids": ids})
