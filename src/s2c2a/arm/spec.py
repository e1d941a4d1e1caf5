"""The description of an arm: frozen values, checked when built."""

import math
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from s2c2a.arm.fields import Frozen, Number, Numbers, Within, between, largest_gap_deg
from s2c2a.arm.mismatch import Mismatch
from s2c2a.arm.sensors import Sensors

MAX_MODULES = 20
GRAVITY = 9.81  # m/s2
NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"
SENSING = r"^(encoders|true|[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}|[A-Za-z0-9_./-]{1,200}:[A-Za-z_][A-Za-z0-9_]{0,63})$"


class Cable(Frozen):
    """How the cables of one module pass on what their motors do.

    Each cable pulls and never pushes. Between motor and module it loses motion in three
    ways that can be mixed: backlash, capstan friction in its housing tube, creep of the
    material. All three are zero unless stated.
    """

    unsaid: ClassVar[frozenset[str]] = frozenset(("viscous_friction",))

    travel: Number | None = between(
        0.0001,
        2,
        "m",
        "how far motors may move it from rest, either way; cable_radius times full bend if none",
        None,
    )
    stiffness: Number = between(
        50, 1e6, "N/m", "stiffness from motor to module end; softer the longer", 1e5
    )
    backlash: Annotated[Numbers, Within(0, 0.02)] = Field(
        default=0.0,
        description="half-width of the backlash between motor and module; displacement arms [m]",
    )
    friction: Number = between(
        0, 1, "1", "capstan friction coefficient of cable in tube", 0.0
    )
    friction_angle_deg: Number = between(
        0, 1440, "deg", "bend of the tube with the arm straight", 90.0
    )
    viscous_friction: Number = between(
        0, 10_000, "N s/m", "friction that grows with the speed of the cable", 0.0
    )
    creep: Number = between(
        0,
        0.9,
        "1",
        "part of a held motion that creep takes back in the end; displacement arms",
        0.0,
    )
    creep_time: Number = between(0.1, 3600, "s", "time constant of creep", 5.0)

    def backlashes(self, count: int) -> tuple[float, ...]:
        """Play of each of so many cables [m]."""
        return (
            self.backlash
            if isinstance(self.backlash, tuple)
            else (self.backlash,) * count
        )


class Module(Frozen):
    """One soft module; several in a row, base first, make the arm."""

    unsaid: ClassVar[frozenset[str]] = frozenset(("mismatch",))

    length: Number = between(0.005, 2, "m", "length of the center line")
    cable_radius: Number = between(
        0.0015,
        0.3,
        "m",
        "distance of the cables from the center line; at most the length",
    )
    cable_angles_deg: tuple[Annotated[Number, Field(ge=-3600, le=3600)], ...] = Field(
        min_length=3,
        max_length=8,
        description="where the cables are, from x to y, no gap of 179 or more [deg]",
    )
    mass: Number = between(0.0005, 10, "kg", "mass")
    bending_stiffness: Number = between(0.0005, 50, "N m2", "EI")
    torsional_stiffness: Number | None = between(
        0.0005, 50, "N m2", "GJ; as EI if none", None
    )
    damping_time: Number = between(0.005, 2, "s", "damping over stiffness", 0.05)
    bend_limit_deg: Number = between(1, 150, "deg", "largest bend asked for", 50.0)
    pretension: Number = between(0, 500, "N", "tension of every cable at rest", 0.0)
    tension_range: Number | None = between(
        0.05, 500, "N", "tension added at full bend; tension arms need it", None
    )
    cable: Cable = Cable()
    mismatch: Mismatch = Mismatch()

    @property
    def gj(self) -> float:
        """Torsional stiffness GJ [N m2]."""
        return (
            self.bending_stiffness
            if self.torsional_stiffness is None
            else self.torsional_stiffness
        )

    @model_validator(mode="after")
    def _can_be_built(self):
        gap = largest_gap_deg(self.cable_angles_deg)
        if gap >= 179.0:
            raise ValueError(
                f"cable_angles_deg {list(self.cable_angles_deg)} leave a gap of {gap:.0f} deg and cables only pull, "
                "so the module cannot bend every way; spread them so that no gap reaches 179 deg"
            )
        if self.cable_radius > self.length:
            raise ValueError(
                f"cable_radius {self.cable_radius} m exceeds length {self.length} m; both are in meters"
            )
        self._check_cables()
        return self

    def _check_cables(self):
        count = len(self.cable_angles_deg)
        for key, value in {
            "cable.backlash": self.cable.backlash,
            **self.mismatch.per_cable(),
        }.items():
            if isinstance(value, tuple) and len(value) != count:
                raise ValueError(
                    f"{key} has {len(value)} numbers; give one for each of the {count} cables, or one"
                )
        true_angles = np.add(self.cable_angles_deg, self.mismatch.angle_errors_deg)
        if (gap := largest_gap_deg(true_angles)) >= 180.0:
            raise ValueError(
                f"with mismatch.angle_errors_deg the cables leave a gap of {gap:.0f} deg; make them smaller"
            )


class Motor(Frozen):
    """The motors and their encoders, the same for every cable."""

    unsaid: ClassVar[frozenset[str]] = frozenset(("homing_error", "current_friction"))

    time_constant: Number = between(0, 1, "s", "first-order lag", 0.0)
    speed_limit: Number | None = between(
        0.001,
        5000,
        "m/s or N/s",
        "largest rate of change; displacement arms at most 5",
        None,
    )
    pulley_radius: Number = between(0.001, 0.2, "m", "radius of the pulley", 0.01)
    ticks_per_turn: int = between(16, 2**24, "1", "encoder ticks in one turn", 4096)
    noise_ticks: Number = between(
        0, 1000, "ticks", "standard deviation of the encoder's noise", 1.0
    )
    noise_tension: Number = between(
        0, 50, "N", "standard deviation of the tension sensor's noise", 0.0
    )
    homing_error: Number = between(
        0,
        0.02,
        "m",
        "standard deviation of its zero, anew at every opening; displacement arms",
        0.0,
    )
    current_noise: Number | None = between(
        0,
        500,
        "N",
        "standard deviation of the tension that its current tells; no such sensor if none",
        None,
    )
    current_friction: Number = between(
        0, 500, "N", "friction of its gear, which the current has to overcome", 0.0
    )


class ArmSpec(Frozen):
    """A modular soft arm: modules from base to tip, motors, mounting, limits.

    Lengths in meters, masses in kilograms, forces in newtons; keys that end in `_deg`
    in degrees.
    """

    unsaid: ClassVar[frozenset[str]] = frozenset(("sensors",))

    name: str = Field(pattern=NAME, description="in tables, figures and names of files")
    description: str = Field("", description="a line about it")
    actuation: Literal["displacement", "tension"] = Field(
        description="what its motors are told"
    )
    sensing: str = Field(
        "encoders",
        pattern=SENSING,
        description="what tells how modules bend: the motors' encoders, something that sees it, or your own",
        json_schema_extra={"allowed": '"encoders", "true" or "file.py:Name"'},
    )
    sensing_coupling: (
        tuple[tuple[Annotated[Number, Field(ge=-100, le=100)], ...], ...] | None
    ) = Field(
        None,
        description="how much a module's sensor, one row each, takes in of each module's configuration [1]",
    )
    coupled_cables: bool = Field(
        False,
        description="whether cables of outer modules pass through inner ones at their radius and bend them",
    )
    gravity_direction: tuple[Number, Number, Number] = Field(
        (0.0, 0.0, -1.0),
        description="down, z along the straight arm: [0, 0, -1] stands, [0, 0, 1] hangs, [0, 0, 0] none",
    )
    control_rate: Number = between(0.5, 1000, "Hz", "control steps a second", 10.0)
    step_limit_deg: Number = between(
        0.01,
        90,
        "deg",
        "largest change of a plan and of a command, per module and step",
        4.0,
    )
    acceleration_limit_deg: Number | None = between(
        0.001,
        180,
        "deg",
        "largest change of that change; 1.5 times as large if none",
        None,
    )
    motor: Motor = Motor()
    sensors: Sensors = Sensors()
    modules: tuple[Module, ...] = Field(
        min_length=1,
        max_length=MAX_MODULES,
        description="base first, all with as many cables",
    )

    @model_validator(mode="after")
    def _fits_together(self):
        counts = [len(module.cable_angles_deg) for module in self.modules]
        if len(set(counts)) > 1:
            raise ValueError(f"modules have {counts} cables; give every module as many")
        self._check_gravity()
        self._check_coupling()
        if self.actuation == "tension":
            self._check_tension_arm()
        elif self.motor.speed_limit is not None and self.motor.speed_limit > 5:
            raise ValueError(
                f"motor.speed_limit {self.motor.speed_limit} m/s exceeds 5 m/s; it is in meters a second"
            )
        return self

    def _check_gravity(self):
        norm = math.hypot(*self.gravity_direction)
        if norm != 0 and abs(norm - 1) > 1e-3:
            raise ValueError(
                f"gravity_direction {list(self.gravity_direction)} has length {norm:.3g}; give a unit vector in the "
                "base frame ([0, 0, -1] stands, [0, 0, 1] hangs) or [0, 0, 0] for none"
            )

    def _check_coupling(self):
        rows = self.sensing_coupling
        if rows is not None and {len(rows), *map(len, rows)} != {len(self.modules)}:
            raise ValueError(
                f"sensing_coupling has rows of lengths {[len(row) for row in rows]}; give a square matrix, one row and "
                f"one column for each of the {len(self.modules)} modules"
            )

    def _check_tension_arm(self):
        for number, module in enumerate(self.modules):
            if module.tension_range is None:
                raise ValueError(
                    f"modules.{number}.tension_range is missing; a tension arm needs it [N]"
                )
            if any(module.cable.backlashes(self.cable_count)) or module.cable.creep:
                raise ValueError(
                    f"modules.{number}.cable has backlash or creep, which act on displacement; "
                    "a tension arm can only have friction"
                )
            if module.cable.travel is not None:
                raise ValueError(
                    f"modules.{number}.cable.travel is of displacement arms; tension_range is its like"
                )
        if self.motor.homing_error:
            raise ValueError(
                "motor.homing_error acts on displacement; a tension arm needs no homing"
            )

    def same_mechanics(self, other: "ArmSpec") -> bool:
        """Whether another arm is the same in all but name, description, and what it sensors beside its motors."""
        return not self.differences(other)

    def differences(self, other: "ArmSpec") -> list[str]:
        """Keys in which another arm differs, name, description and sensors beside its motors' aside."""
        aside: Any = {
            "name": True,
            "description": True,
            "sensors": True,
            "motor": {"current_noise", "current_friction"},
        }
        mine, others = (arm.model_dump(exclude=aside) for arm in (self, other))
        return [key for key in mine if mine[key] != others[key]]

    @property
    def module_count(self) -> int:
        """Number of modules m."""
        return len(self.modules)

    @property
    def cable_count(self) -> int:
        """Number of cables of each module n."""
        return len(self.modules[0].cable_angles_deg)

    @property
    def length(self) -> float:
        """Length of the straight arm [m]."""
        return sum(module.length for module in self.modules)

    @property
    def gravity(self) -> tuple[float, ...]:
        """In the base frame [m/s2]."""
        return tuple(GRAVITY * part for part in self.gravity_direction)

    @property
    def control_period(self) -> float:
        """Seconds of one control step."""
        return 1.0 / self.control_rate
