"""Description of an arm: frozen values, validated when built."""

import math
import warnings
from operator import attrgetter
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticKnownError

from s2c2a.arm.fields import (
    FORCE,
    LENGTH,
    LOST_MOTION,
    MASS,
    PRESSURE,
    RIGIDITY,
    SHARE,
    Free,
    Frozen,
    Number,
    Numbers,
    Within,
    absent,
    between,
    largest_gap_deg,
    optional,
)
from s2c2a.arm.mismatch import Mismatch
from s2c2a.arm.sensors import Sensors
from s2c2a.arm.servos import Servos
from s2c2a.arm.tracking import Tracking
from s2c2a.errors import counted
from s2c2a.printing import differences

MAX_MODULES = 20  # as many as the benchmarks cover
MAX_PAYLOAD = 50.0  # kg; most payloads that were given in grams exceed it
HEAVIEST = 3.0
"""Payload in parts of the arm's mass; no more is estimated, and soft arms carry less."""
GRAVITY = 9.81  # m/s2, at sea level in middle latitudes
MAX_GAP_DEG = 179.0
"""Between cables that pull every way; at 180 one direction has no pull at all."""
LIGHTEST = 5.0
"""Density [kg/m3] of a module as thick as its circle of cables; foam has 20."""
SOFTEST = 1e4
"""Elastic modulus [Pa] of such a module; the softest silicones have 1e4 to 1e5."""
USUAL = 0.0005
"""Mass [kg] and bending stiffness [N m2] that every module may have."""
UNITS = {"displacement": "m", "tension": "N", "pressure": "Pa"}
REQUIRED = {
    "tension": ("tension_range",),
    "pressure": ("pressure_limit", "chamber_area"),
}
"""Keys of modules that a kind of actuation needs."""
FASTEST = {"displacement": 5.0, "tension": 5000.0, "pressure": 1e8}
"""Largest rates of actions, in units a second; chosen far beyond motors and valves."""
PER_CABLE = "cable.backlash", "mismatch.angle_errors_deg", "mismatch.radius_errors"
"""Keys of modules with one number, or one for each cable."""
NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"
SENSING = (
    r"^(encoders|true|[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}"
    r"|[A-Za-z0-9_./-]{1,200}:[A-Za-z_][A-Za-z0-9_]{0,63})$"
)


class Cable(Frozen):
    """Transmission from the motors to one module.

    Each cable pulls and never pushes. Between motor and module it loses motion by
    backlash, by capstan friction in its housing tube and by creep of the material. All
    three are zero by default and can be combined. The default stiffness hardly yields:
    0.1 mm under 10 N.
    """

    omitted_defaults: ClassVar[frozenset[str]] = frozenset(("viscous_friction",))

    travel: Number | None = LENGTH.key(
        "largest displacement from rest in either direction; default: "
        "cable_radius times full bend",
        None,
    )
    stiffness: Number = between(
        50,
        1e6,
        "N/m",
        "stiffness between motor and module end; longer cables have less",
        1e5,
    )
    backlash: Annotated[Numbers, Within(0, 0.02)] = absent(
        "half-width of the backlash between motor and module; displacement arms [m]"
    )
    friction: Number = SHARE.effect("capstan friction coefficient of cable in tube")
    friction_angle_deg: Number = between(
        0, 1440, "deg", "bend of the tube with the arm straight", 90.0
    )
    viscous_friction: Number = between(
        0, 10_000, "N s/m", "viscous friction coefficient", 0.0
    )
    creep: Number = between(
        0,
        0.9,
        "1",
        "share of a held displacement that creep finally takes back; displacement arms",
        0.0,
    )
    creep_time: Number = between(0.1, 3600, "s", "time constant of creep", 5.0)


class Module(Frozen):
    """One soft module; an arm is a series of modules, base first."""

    omitted_defaults: ClassVar[frozenset[str]] = frozenset(
        ("mismatch", "radius", "pressure_limit", "rest_pressure", "chamber_area")
    )

    length: Number = LENGTH.key("length of the center line")
    radius: Number = LENGTH.effect("radius of the body, which keeps clear of obstacles")
    cable_radius: Number = LENGTH.key(
        "distance of the cables from the center line; at most the length"
    )
    cable_angles_deg: tuple[Free, ...] = Field(
        max_length=8,
        description=(
            "angles of the cables, from x to y, without a gap of 179 or more; two "
            "opposed ones bend the module in one plane, and a passive module has none "
            "[deg]"
        ),
    )
    mass: Number = MASS.key("mass")
    bending_stiffness: Number = RIGIDITY.key("EI")
    torsional_stiffness: Number | None = RIGIDITY.key("GJ; default: EI", None)
    damping_time: Number = between(0.005, 2, "s", "damping divided by stiffness", 0.05)
    bend_limit_deg: Number = between(1, 170, "deg", "largest planned bend", 50.0)
    pretension: Number = FORCE.effect("tension of every cable at rest")
    tension_range: Number | None = FORCE.key(
        "tension added at full bend; required for tension arms", None
    )
    pressure_limit: Number | None = PRESSURE.key(
        "largest pressure of a chamber, at full bend; required for pressure arms", None
    )
    rest_pressure: Number = PRESSURE.effect("pressure of every chamber at rest")
    chamber_area: Number | None = between(
        1e-8, 0.1, "m2", "cross-section of a chamber; required for pressure arms", None
    )
    cable: Cable = Cable()
    mismatch: Mismatch = Mismatch()

    @property
    def gj(self) -> float:
        """Torsional stiffness GJ [N m2]."""
        if self.torsional_stiffness is None:
            return self.bending_stiffness
        return self.torsional_stiffness

    @field_validator("mass", "bending_stiffness")
    @classmethod
    def _check_scale(cls, value: float, info: ValidationInfo) -> float:
        """Refuse values that are small even for so small a module."""
        if not {"length", "cable_radius"} <= info.data.keys():
            return value  # these are refused themselves
        radius = info.data["cable_radius"]
        least = LIGHTEST * np.pi * radius**2 * info.data["length"]
        if info.field_name == "bending_stiffness":
            least = SOFTEST * np.pi * radius**4 / 4.0
        least = float(f"{min(least, USUAL):.2g}")
        if value < least:
            raise PydanticKnownError("greater_than_equal", {"ge": least})
        return value

    @property
    def is_planar(self) -> bool:
        """Whether its cables lie on one line, on both sides, and bend it in one plane."""
        angles_deg = self.cable_angles_deg
        if len(angles_deg) < 2:
            return False
        turned = np.deg2rad(np.subtract(angles_deg, angles_deg[0]))
        tolerance = np.sin(np.deg2rad(MAX_GAP_DEG))
        is_on_line = np.abs(np.sin(turned)) <= tolerance
        return bool(is_on_line.all() and np.cos(turned).min() < 0.0)

    @model_validator(mode="after")
    def _validate(self):
        if len(self.cable_angles_deg) and not self.is_planar:
            gap = largest_gap_deg(self.cable_angles_deg)
            if gap >= MAX_GAP_DEG:
                raise ValueError(
                    f"cable_angles_deg {list(self.cable_angles_deg)} leave a gap of "
                    f"{gap:.0f} deg and cables only pull, so the module cannot bend in "
                    f"every direction; spread them so that no gap reaches {MAX_GAP_DEG:.0f} "
                    "deg, or give two opposed cables, such as [0, 180], for bends in one "
                    "plane, or none, [], for a passive module; a spring in place of the "
                    "second cable is not described"
                )
        if self.cable_radius > self.length:
            raise ValueError(
                f"cable_radius {self.cable_radius} m exceeds length {self.length} m; "
                "both are in meters"
            )
        self._check_cables()
        return self

    def _check_cables(self):
        count = len(self.cable_angles_deg)
        for key in PER_CABLE:
            value = attrgetter(key)(self)
            if isinstance(value, tuple) and len(value) != count:
                raise ValueError(
                    f"{key} has {len(value)} numbers; "
                    f"give one for each of the {count} cables, or one"
                )
        if not count or self.is_planar:
            return
        true_angles = np.add(self.cable_angles_deg, self.mismatch.angle_errors_deg)
        gap = largest_gap_deg(true_angles)
        if gap >= MAX_GAP_DEG:
            raise ValueError(
                "with mismatch.angle_errors_deg the cables leave a gap of "
                f"{gap:.0f} deg; give smaller errors"
            )


class Motor(Frozen):
    """The motors and their encoders, the same for every cable.

    The default encoder is that of the servos of `MODEL_NUMBERS`, 4096 ticks a turn.
    """

    omitted_defaults: ClassVar[frozenset[str]] = frozenset(
        ("homing_error", "current_friction", "noise_pressure")
    )

    time_constant: Number = between(0, 1, "s", "first-order lag", 0.0)
    speed_limit: Number | None = between(
        0.001,
        1e8,
        "m/s, N/s or Pa/s",
        "largest rate of change; displacement arms at most 5, tension arms 5000",
        None,
    )
    pulley_radius: Number = LENGTH.key("radius of the pulley", 0.01)
    ticks_per_turn: int = between(16, 2**24, "1", "encoder ticks in one turn", 4096)
    noise_ticks: Number = between(
        0, 1000, "ticks", "standard deviation of the encoder's noise", 1.0
    )
    noise_tension: Number = FORCE.effect(
        "standard deviation of the tension sensor's noise"
    )
    noise_pressure: Number = PRESSURE.effect(
        "standard deviation of the pressure sensor's noise"
    )
    homing_error: Number = LOST_MOTION.effect(
        "standard deviation of the zero, new at every opening; displacement arms"
    )
    current_noise: Number | None = FORCE.effect(
        "standard deviation of the tension from motor current; default: no such sensor",
        None,
    )
    current_friction: Number = FORCE.effect(
        "friction of the gear, which the current contains"
    )

    @property
    def tick_length(self) -> float:
        """Displacement of one encoder tick [m]."""
        return 2 * np.pi * self.pulley_radius / self.ticks_per_turn

    def measurement_noise(self, actuation: str) -> float:
        """Standard deviation of encoders [m], or of sensors of tension [N] or pressure.

        Args:
            actuation: of the arm.
        """
        if actuation == "tension":
            return self.noise_tension
        if actuation == "pressure":
            return self.noise_pressure
        return self.tick_length * (1 + self.noise_ticks)


def counts_of(modules: tuple[Module, ...]) -> list[int]:
    """Return the number of cables of every module."""
    return [len(module.cable_angles_deg) for module in modules]


class Tip(Frozen):
    """What the last module always carries: a gripper, a tool, a plate with markers.

    A payload is what it holds, and adds to this.
    """

    mass: Number = MASS.effect("mass at the end of the last module")


class ArmSpec(Frozen):
    """A modular soft arm: modules from base to tip, motors, mounting, limits.

    Lengths in meters, masses in kilograms, forces in newtons; keys that end in `_deg`
    in degrees.
    """

    omitted_defaults: ClassVar[frozenset[str]] = frozenset(
        ("sensors", "servos", "tip", "tracking")
    )

    name: str = Field(
        pattern=NAME, description="name in tables, figures and file names"
    )
    description: str = optional("one line of description", "")
    actuation: Literal["displacement", "tension", "pressure"] = Field(
        description=(
            "unit of commands: cable displacement [m], cable tension [N], or pressure of "
            "chambers that push [Pa]; chambers take the keys of cables"
        )
    )
    sensing: str = optional(
        "source of configurations: encoders, true configurations, or a user's sensor",
        "encoders",
        pattern=SENSING,
        json_schema_extra={"allowed": '"encoders", "true" or "file.py:Name"'},
    )
    sensing_coupling: tuple[tuple[Free, ...], ...] | None = optional(
        "matrix from true to sensed configurations, one row a module [1]"
    )
    coupled_cables: bool = optional(
        "whether cables of distal modules also bend the proximal modules that "
        "they pass",
        False,
    )
    gravity_direction: tuple[Number, Number, Number] = optional(
        "direction of gravity: [0, 0, -1] upright, [0, 0, 1] hanging, [0, 0, 0] none",
        (0.0, 0.0, -1.0),
    )
    control_rate: Number = between(0.01, 1000, "Hz", "control steps a second", 10.0)
    step_limit_deg: Number = between(
        0.01,
        90,
        "deg",
        "largest change of plans and commands, per module and step",
        4.0,
    )
    acceleration_limit_deg: Number | None = between(
        0.001,
        180,
        "deg",
        "largest change of that change per step; default: 1.5 * step_limit_deg",
        None,
    )
    motor: Motor = Motor()
    sensors: Sensors = Sensors()
    servos: Servos | None = optional("servos of a real arm")
    tip: Tip = Tip()
    tracking: Tracking | None = optional("pose tracking of a real arm's module ends")
    modules: tuple[Module, ...] = Field(
        min_length=1,
        max_length=MAX_MODULES,
        description="base first; at least one has cables",
    )

    def __str__(self) -> str:
        """Name, size and kind; `s2c2a arm check` and the arm file have the rest."""
        size = f"{self.layout}, {self.length:.3g} m, {self.mass:.3g} kg"
        tip = f" with {1e3 * self.tip.mass:.3g} g at the tip" if self.tip.mass else ""
        return f"{self.name}, {size}{tip}, {self.actuation}"

    @model_validator(mode="after")
    def _validate(self):
        if not self.cable_count:
            raise ValueError(
                "no module has cables; give cable_angles_deg of at least one module"
            )
        norm = math.hypot(*self.gravity_direction)
        # three digits, as people write them
        if norm != 0 and abs(norm - 1) > 1e-3:
            raise ValueError(
                f"gravity_direction {list(self.gravity_direction)} has length "
                f"{norm:.3g}; give a unit vector in the base frame "
                "([0, 0, -1] upright, [0, 0, 1] hanging) or [0, 0, 0] for no gravity"
            )
        rows = self.sensing_coupling
        if rows is not None and {len(rows), *map(len, rows)} != {len(self.modules)}:
            raise ValueError(
                f"sensing_coupling has rows of lengths {[len(row) for row in rows]}; "
                "give a square matrix, one row and one column for each of the "
                f"{len(self.modules)} modules"
            )
        self._check_servos()
        ends = None if self.tracking is None else self.tracking.ends
        if ends is not None and len(ends) != len(self.modules):
            raise ValueError(
                f"tracking.ends has {len(ends)} names; give one for each of the "
                f"{len(self.modules)} modules, empty where none is tracked"
            )
        if self.actuation != "displacement":
            self._check_force_arm()
        fastest = FASTEST[self.actuation]
        if self.motor.speed_limit is not None and self.motor.speed_limit > fastest:
            raise ValueError(
                f"motor.speed_limit {self.motor.speed_limit} {self.unit}/s exceeds "
                f"{fastest:g} {self.unit}/s, which no motor of a {self.actuation} arm "
                "reaches; check its unit"
            )
        return self

    @property
    def unit(self) -> str:
        """Unit of actions: m, N or Pa."""
        return UNITS[self.actuation]

    def _check_servos(self):
        if self.servos is None:
            return
        rows = [len(row) for row in self.servos.ids]
        counts = counts_of(self.modules)
        if rows != counts:
            raise ValueError(
                f"servos.ids has rows of lengths {rows}; give one row for each of the "
                f"{len(self.modules)} modules and one servo for each of its cables: "
                f"{counts}"
            )
        if self.actuation != "displacement":
            raise ValueError(
                "servos wind cables by displacement; "
                'write actuation = "displacement", or leave out [servos]'
            )

    def _check_force_arm(self):
        """Check an arm whose actions are tensions or pressures."""
        kind = self.actuation
        for number, module in enumerate(self.modules):
            for key in REQUIRED[kind]:
                if getattr(module, key) is None:
                    raise ValueError(
                        f"modules.{number}.{key} is missing; a {kind} arm needs it"
                    )
            if np.any(module.cable.backlash) or module.cable.creep:
                raise ValueError(
                    f"modules.{number}.cable has backlash or creep, which act on "
                    f"displacement; leave them out for a {kind} arm"
                )
            if module.cable.travel is not None:
                raise ValueError(
                    f"modules.{number}.cable.travel is for displacement arms; "
                    f"use {REQUIRED[kind][0]}"
                )
            if kind == "pressure":
                if module.pretension or module.cable.friction:
                    raise ValueError(
                        f"modules.{number} has pretension or cable.friction, which cables have; "
                        "a pressure arm has rest_pressure"
                    )
                assert module.pressure_limit is not None  # checked before
                if module.rest_pressure >= module.pressure_limit:
                    raise ValueError(
                        f"modules.{number}.rest_pressure {module.rest_pressure} Pa is not below "
                        f"pressure_limit {module.pressure_limit} Pa; lower it"
                    )
                if self.coupled_cables or self.motor.current_noise is not None:
                    raise ValueError(
                        "coupled_cables and motor.current_noise are for cables; leave them out "
                        "for a pressure arm"
                    )
        if self.motor.homing_error:
            raise ValueError(
                f"motor.homing_error acts on displacement; a {kind} arm needs no homing"
            )

    def differences(self, other: "ArmSpec") -> list[str]:
        """Return the keys in which the mechanics of another arm differ, with both values.

        Name, description, limits of steps, radii of bodies (which keep clear of obstacles
        alone), `sensors`, `servos`, `tracking` and motor currents are not compared.
        """
        excluded: Any = {
            "name": True,
            "description": True,
            "step_limit_deg": True,
            "acceleration_limit_deg": True,
            "sensors": True,
            "servos": True,
            "tracking": True,
            "motor": {"current_noise", "current_friction"},
            "modules": {"__all__": {"radius"}},
        }
        values = self.model_dump(exclude=excluded)
        return differences(values, other.model_dump(exclude=excluded))

    @property
    def module_count(self) -> int:
        """Number of modules m."""
        return len(self.modules)

    @property
    def cable_count(self) -> int:
        """Largest number of cables of a module, n.

        Arrays over cables have as many columns; those beyond a module's own cables are
        zero.
        """
        return max(counts_of(self.modules))

    @property
    def layout(self) -> str:
        """Modules and cables in words."""
        counts = counts_of(self.modules)
        cables = counted(counts[-1], "cable")
        if len(set(counts)) > 1:
            cables = f"{', '.join(map(str, counts[:-1]))} and {cables}"
        return f"{counted(len(counts), 'module')} of {cables}"

    @property
    def length(self) -> float:
        """Length of the straight arm [m]."""
        return sum(module.length for module in self.modules)

    @property
    def mass(self) -> float:
        """Mass of the modules, and of what is at the tip [kg]."""
        return sum(module.mass for module in self.modules) + self.tip.mass

    @property
    def gravity(self) -> tuple[float, ...]:
        """Gravity in the base frame [m/s2]."""
        return tuple(GRAVITY * part for part in self.gravity_direction)

    @property
    def control_period(self) -> float:
        """Duration of one control step [s]."""
        return 1.0 / self.control_rate


def warn_of_payload(payload: float, arm: ArmSpec) -> None:
    """Warn of a payload [kg] that is far heavier than the arm."""
    if payload > HEAVIEST * arm.mass:
        warnings.warn(
            f"a payload of {payload:g} kg, {1000 * payload:g} g, hangs at '{arm.name}' "
            f"of {arm.mass:.3g} kg; check its unit",
            stacklevel=2,
        )
