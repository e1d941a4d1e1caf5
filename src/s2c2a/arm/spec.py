"""The description of an arm: frozen values, checked when built."""

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

MOST_MODULES = 20
NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"
SENSING = r"^(encoders|true|[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}|[A-Za-z0-9_./-]{1,200}:[A-Za-z_][A-Za-z0-9_]{0,63})$"


def _between(low: float, high: float, unit: str, meaning: str, default: Any = ...) -> Any:
    """A number with the range of plausible arms; a value wrong by a factor of 1000 falls outside of it."""
    return Field(default, ge=low, le=high, description=f"{meaning} [{unit}]")


def _refuse_text_and_truth(value):
    if isinstance(value, str | bool):
        raise ValueError(f"a number is needed, without quotes, got {value!r}")
    return value


Number = Annotated[float, BeforeValidator(_refuse_text_and_truth)]


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=False)


def largest_gap_deg(angles_deg) -> float:
    """Largest angle between neighbouring cables [deg]."""
    around = np.sort(np.mod(angles_deg, 360.0))
    return float(np.max(np.diff(np.append(around, around[0] + 360.0))))


class Cable(_Frozen):
    """How the cables of one module pass on what their motors do.

    Each cable pulls and never pushes. Between motor and module it loses motion in three ways that can be mixed: play,
    capstan friction in its housing tube, creep of the material. All three are zero unless stated.
    """

    stiffness: Number = _between(50, 1e6, "N/m", "stiffness from motor to module end; softer the longer", 1e5)
    play: Number = _between(0, 0.02, "m", "half-width of the play between motor and module; displacement arms", 0.0)
    friction: Number = _between(0, 1, "1", "capstan friction coefficient of cable in tube", 0.0)
    friction_angle_deg: Number = _between(0, 1440, "deg", "bend of the tube with the arm straight", 90.0)
    creep: Number = _between(
        0, 0.9, "1", "part of a held motion that creep takes back in the end; displacement arms", 0.0
    )
    creep_time: Number = _between(0.1, 3600, "s", "time constant of creep", 5.0)


class Module(_Frozen):
    """One soft module; several in a row, base first, make the arm."""

    length: Number = _between(0.005, 2, "m", "length of the centre line")
    cable_radius: Number = _between(0.0015, 0.3, "m", "distance of the cables from the centre line; at most the length")
    cable_angles_deg: tuple[Annotated[Number, Field(ge=-3600, le=3600)], ...] = Field(
        min_length=3, max_length=8, description="where the cables are, from x to y, no gap of 179 or more [deg]"
    )
    mass: Number = _between(0.0005, 10, "kg", "mass")
    bending_stiffness: Number = _between(0.0005, 50, "N m2", "EI")
    torsional_stiffness: Number | None = _between(0.0005, 50, "N m2", "GJ; as EI if none", None)
    damping_time: Number = _between(0.005, 2, "s", "damping over stiffness", 0.05)
    bend_limit_deg: Number = _between(1, 150, "deg", "largest bend asked for", 50.0)
    pretension: Number = _between(0, 500, "N", "tension of every cable at rest", 0.0)
    tension_range: Number | None = _between(0.05, 500, "N", "tension added at full bend; tension arms need it", None)
    cable: Cable = Cable()

    @property
    def gj(self) -> float:
        """Torsional stiffness GJ [N m2]."""
        return self.bending_stiffness if self.torsional_stiffness is None else self.torsional_stiffness

    @model_validator(mode="after")
    def _can_be_built(self):
        gap = largest_gap_deg(self.cable_angles_deg)
        if gap >= 179.0:
            raise ValueError(
                f"cable_angles_deg {list(self.cable_angles_deg)} leave a gap of {gap:.0f} deg and cables only pull, "
                "so the module cannot bend every way; spread them so that no gap reaches 179 deg"
            )
        if self.cable_radius > self.length:
            raise ValueError(f"cable_radius {self.cable_radius} m exceeds length {self.length} m; both are in metres")
        return self


class Motor(_Frozen):
    """The motors and their encoders, the same for every cable."""

    time_constant: Number = _between(0, 1, "s", "first-order lag", 0.0)
    speed_limit: Number | None = _between(
        0.001, 5000, "m/s or N/s", "largest rate of change; displacement arms at most 5", None
    )
    pulley_radius: Number = _between(0.001, 0.2, "m", "radius of the pulley", 0.01)
    ticks_per_turn: int = _between(16, 2**24, "1", "encoder ticks in one turn", 4096)
    noise_ticks: Number = _between(0, 1000, "ticks", "standard deviation of the encoder's noise", 1.0)
    noise_tension: Number = _between(0, 50, "N", "standard deviation of the tension sensor's noise", 0.0)


class ArmSpec(_Frozen):
    """A modular soft arm: modules from base to tip, motors, mounting, limits.

    Lengths in metres, masses in kilograms, forces in newtons; keys that end in `_deg` in degrees.
    """

    name: str = Field(pattern=NAME, description="in tables, figures and names of files")
    description: str = Field("", description="a line about it")
    actuation: Literal["displacement", "tension"] = Field(description="what its motors are told")
    sensing: str = Field(
        "encoders",
        pattern=SENSING,
        description="what tells how modules bend: the motors' encoders, something that sees it, or your own",
        json_schema_extra={"allowed": '"encoders", "true" or "file.py:Name"'},
    )
    sensing_coupling: tuple[tuple[Annotated[Number, Field(ge=-100, le=100)], ...], ...] | None = Field(
        None, description="how much a module's sensor, one row each, takes in of each module's configuration [1]"
    )
    coupled_cables: bool = Field(
        False, description="whether cables of outer modules pass through inner ones at their radius and bend them"
    )
    gravity_direction: tuple[Number, Number, Number] = Field(
        (0.0, 0.0, -1.0),
        description="down, z along the straight arm: [0, 0, -1] stands, [0, 0, 1] hangs, [0, 0, 0] none",
    )
    control_rate: Number = _between(0.5, 1000, "Hz", "control steps a second", 10.0)
    step_limit_deg: Number = _between(
        0.01, 90, "deg", "largest change of a plan and of a command, per module and step", 4.0
    )
    acceleration_limit_deg: Number | None = _between(
        0.001, 180, "deg", "largest change of that change; 1.5 times as large if none", None
    )
    motor: Motor = Motor()
    modules: tuple[Module, ...] = Field(
        min_length=1, max_length=MOST_MODULES, description="base first, all with as many cables"
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
            raise ValueError(f"motor.speed_limit {self.motor.speed_limit} m/s exceeds 5 m/s; it is in metres a second")
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
                raise ValueError(f"modules.{number}.tension_range is missing; a tension arm needs it [N]")
            if module.cable.play or module.cable.creep:
                raise ValueError(
                    f"modules.{number}.cable has play or creep, which act on displacement; "
                    "a tension arm can only have friction"
                )

    def same_body(self, other: "ArmSpec") -> bool:
        """Whether another arm is the same in all but name and description."""
        return not self.differences(other)

    def differences(self, other: "ArmSpec") -> list[str]:
        """Keys in which another arm differs, name and description aside."""
        mine, others = (arm.model_dump(exclude={"name", "description"}) for arm in (self, other))
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
    def control_period(self) -> float:
        """Seconds of one control step."""
        return 1.0 / self.control_rate
