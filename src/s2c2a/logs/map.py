"""The map: a TOML file that says what a log holds. Frozen values, checked when built, errors that name the key."""

import os
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from s2c2a.arm.spec import MAX_MODULES, NAME, Number
from s2c2a.errors import S2C2AError
from s2c2a.validation import explained
from s2c2a.files import read_text, toml_in
from s2c2a.logs.errors import LogError

LONGEST = 300
HEADING = "{count} fault(s) in the map (drives, ends and modules count from 0)"
MAX_CABLES = 8 * MAX_MODULES
SIGNED_AXIS = r"^[+-]?[xyz]$"
Column = Annotated[str, Field(min_length=1, max_length=200)]
Three = tuple[Number, Number, Number]
Part = Annotated[int, Field(ge=0, lt=MAX_MODULES)]


class Frozen(BaseModel):
    """A table of numbers and words, checked when built."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Source(Frozen):
    """Where a log comes from; kept with what is made of it."""

    name: str = Field(
        default="", max_length=LONGEST, description="whose arm, which session"
    )
    address: str = Field(
        default="", max_length=LONGEST, description="where the log can be had"
    )
    commit: str = Field(default="", max_length=LONGEST, description="its version there")
    license: str = Field(
        default="", max_length=LONGEST, description="under which it may be used"
    )


class Rows(Frozen):
    """How rows follow each other, and where episodes end."""

    kind: Literal["timed", "steps"] = Field(
        default="timed",
        description="moments in time, resampled to the control rate; or settled poses, one control step each",
    )
    time: Column | None = Field(
        default=None, description="column of the time; if none, rows follow at `rate`"
    )
    unit: Literal["s", "ms", "us", "ns", "min"] | Number = Field(
        default="s", description="of that column, or how many seconds"
    )
    rate: Number | None = Field(
        default=None,
        gt=0,
        le=1e5,
        description="rows a second where no column says the time [Hz]",
    )
    longest_gap: Number | None = Field(
        default=None,
        gt=0,
        le=1e6,
        description="beyond this nothing is interpolated and an episode ends; found if none [s]",
    )
    label: Column | None = Field(
        default=None, description="column of text whose changes end an episode"
    )
    commands: Literal["settled", "sent"] | None = Field(
        default=None,
        description='whether a row was measured after its command had settled, or before it is sent; "settled" for '
        'steps, "sent" for timed rows if none',
    )
    shortest: int = Field(
        default=8,
        ge=2,
        le=100_000,
        description="steps that an episode has at least; others are left out",
    )
    first_row: int = Field(
        default=0, ge=0, description="rows left out at the beginning"
    )
    rows: int | None = Field(
        default=None, ge=1, description="rows taken from there; all if none"
    )
    skip_lines: int = Field(
        default=0, ge=0, le=1000, description="lines above the header"
    )
    broken_rows: Literal["refuse", "gap"] = Field(
        default="refuse", description="what a row that cannot be read is"
    )

    @model_validator(mode="after")
    def _tells_time(self):
        if self.kind == "timed" and (self.time is None) == (self.rate is None):
            raise ValueError(
                'timed rows need a column (time) or a rate, one of them; or say kind = "steps"'
            )
        return self


class Join(Frozen):
    """Several files of one session, rows matched by a key."""

    key: Column = Field(description="column that every file has")
    files: int = Field(
        default=2,
        ge=2,
        le=16,
        description="how many files, in the order of the command, make a session",
    )


class Pulled(Frozen):
    """A cable that a motor pulls."""

    turn_deg: Number = Field(
        default=0.0,
        ge=-360,
        le=360,
        description="how far round from the motor's direction [deg]",
    )
    sign: Literal[-1, 1] = Field(
        default=1, description="-1 where it is let go while the motor pulls"
    )


class Drive(Frozen):
    """A motor's column, and the cables on it."""

    commanded: Column | None = Field(
        default=None, description="column of what it was told"
    )
    measured: Column | None = Field(
        default=None, description="column of what its encoder or sensor said"
    )
    unit: Literal["mm", "m", "ticks", "deg", "rad", "turns", "N", "free"] = Field(
        description="of both columns; free: bends in proportion, the factor is found"
    )
    positive: Literal["pulls", "releases", "unknown"] = Field(
        default="unknown",
        description="what a larger number does to the cable; found if unknown",
    )
    offset: Number = Field(
        default=0.0, description="the column's number at rest, in its unit"
    )
    module: Part | None = Field(
        default=None,
        description="that its cables end at, from 0 at the base; found if none",
    )
    angle_deg: Number | None = Field(
        default=None,
        ge=-3600,
        le=3600,
        description="where its cable is; found if none [deg]",
    )
    cables: tuple[Pulled, ...] = Field(
        default=(Pulled(),),
        min_length=1,
        max_length=8,
        description="one, or a pair, or more",
    )

    @model_validator(mode="after")
    def _has_a_column(self):
        if self.commanded is None and self.measured is None:
            raise ValueError("name a column: commanded, measured, or both")
        return self

    @property
    def name(self) -> str:
        """Its column, the measured one if there is one."""
        return self.measured or self.commanded or ""


class End(Frozen):
    """The end of a module, as something outside saw it."""

    module: Part | None = Field(
        default=None, description="from 0 at the base; the last one if none"
    )
    position: tuple[Column, Column, Column] = Field(description="columns of x, y, z")
    unit: Literal["mm", "cm", "m", "in"] = Field(description="of the position")
    axis: tuple[Column, Column, Column] | None = Field(
        default=None, description="columns of a vector along the arm"
    )
    quaternion: tuple[Column, Column, Column, Column] | None = Field(
        default=None, description="columns of a rotation"
    )
    order: Literal["xyzw", "wxyz"] | None = Field(
        default=None, description="of the quaternion's columns"
    )
    euler: tuple[Column, Column, Column] | None = Field(
        default=None, description="columns of three turns"
    )
    sequence: str | None = Field(
        default=None,
        pattern=r"^([xyz]{3}|[XYZ]{3})$",
        description='of the turns: "xyz" about fixed axes, "XYZ" about turned ones',
    )
    euler_unit: Literal["deg", "rad"] = Field(default="deg", description="of the turns")
    along: str | Three = Field(
        default="z",
        description='which way of the tracked body points along the arm: "z", "-y", or a vector',
    )

    @model_validator(mode="after")
    def _says_one_rotation(self):
        given = [
            name
            for name in ("axis", "quaternion", "euler")
            if getattr(self, name) is not None
        ]
        if len(given) > 1:
            raise ValueError(
                f"{' and '.join(given)} are given; give one of them, or none"
            )
        if (self.quaternion is None) != (self.order is None):
            raise ValueError(
                'a quaternion needs its order = "xyzw" or "wxyz", and order belongs to a quaternion'
            )
        if (self.euler is None) != (self.sequence is None):
            raise ValueError(
                'Euler angles need their sequence, such as "xyz" (fixed axes) or "ZYX" (turned ones)'
            )
        return self


class Frame(Frozen):
    """The frame in which positions were measured."""

    along: Annotated[str, Field(pattern=SIGNED_AXIS)] | Three | None = Field(
        default=None,
        description='its direction from the base to the tip of the straight arm: "z", "-y", a vector; found if none',
    )
    x: Annotated[str, Field(pattern=SIGNED_AXIS)] | Three | None = Field(
        default=None,
        description="its direction that shall be x of the base frame; one across the arm if none",
    )
    base: Three | None = Field(
        default=None, description="where the base is in it, in meters; found if none"
    )


class KnownArm(Frozen):
    """What the user knows of the arm; what is left out is found, or a guess that the arm file marks."""

    name: str = Field(pattern=NAME, description="of the arm")
    description: str = Field("", description="a line about it")
    modules: int = Field(ge=1, le=MAX_MODULES, description="how many")
    control_rate: Number = Field(
        ge=0.5, le=1000, description="control steps a second [Hz]"
    )
    length: Number | None = Field(
        None, ge=0.005, le=20, description="of the straight arm; found if none [m]"
    )
    lengths: tuple[Number, ...] | None = Field(
        None, description="of the modules, base first; equal if none [m]"
    )
    cable_radius: Number | None = Field(
        None,
        ge=0.0015,
        le=0.3,
        description="distance of cables from the center line; found if none [m]",
    )
    pulley_radius: Number | None = Field(
        None, ge=0.0005, le=0.2, description="of the motors; for ticks and angles [m]"
    )
    ticks_per_turn: int = Field(
        4096, ge=16, le=2**24, description="encoder ticks in one turn"
    )
    gravity_direction: Three = Field(
        (0.0, 0.0, -1.0), description="down: [0, 0, -1] stands, [0, 0, 1] hangs"
    )
    coupled_cables: bool | None = Field(
        None,
        description="whether cables of outer modules pass through inner ones and bend them; found if none",
    )
    mass: Number = Field(0.05, description="of a module [kg]")
    bending_stiffness: Number = Field(0.1, description="EI of a module [N m2]")
    bend_limit_deg: Number | None = Field(
        None, ge=1, le=150, description="as far as was seen if none [deg]"
    )

    @model_validator(mode="after")
    def _fits_together(self):
        if self.lengths is not None and len(self.lengths) != self.modules:
            raise ValueError(
                f"{len(self.lengths)} lengths for {self.modules} modules; give one each"
            )
        if self.lengths is not None and self.length is not None:
            raise ValueError("length and lengths are given; give one of them")
        return self


class LogMap(Frozen):
    """What a log holds."""

    source: Source = Source()
    rows: Rows = Field(description="how rows follow each other")
    join: Join | None = None
    arm: KnownArm
    drives: tuple[Drive, ...] = Field(min_length=1, max_length=MAX_CABLES)
    ends: tuple[End, ...] = Field(min_length=1, max_length=MAX_MODULES)
    frame: Frame = Frame()

    @model_validator(mode="after")
    def _fits_together(self):
        count = self.arm.modules
        for place, parts in (("drives", self.drives), ("ends", self.ends)):
            if any(part.module is not None and part.module >= count for part in parts):
                raise ValueError(
                    f"{place} name a module beyond the {count} of the arm; they count from 0 at the base"
                )
        places = self.end_modules
        if len(set(places)) < len(places):
            raise ValueError(f"ends are of modules {places}; each module has one end")
        turning = any(
            drive.unit in ("ticks", "deg", "rad", "turns") for drive in self.drives
        )
        if turning and self.arm.pulley_radius is None:
            raise ValueError(
                'columns in ticks or angles need arm.pulley_radius; or say unit = "free" and it is found'
            )
        if (
            any(drive.unit == "free" for drive in self.drives)
            and self.arm.cable_radius is None
        ):
            raise ValueError(
                'unit = "free" needs arm.cable_radius, on which the factor depends'
            )
        if len({drive.unit == "N" for drive in self.drives}) > 1:
            raise ValueError(
                "some drives are in N and others are not; an arm is driven by tension or displacement"
            )
        return self

    @property
    def end_modules(self) -> list[int]:
        """Which modules' ends were measured."""
        return [
            self.arm.modules - 1 if end.module is None else end.module
            for end in self.ends
        ]

    @property
    def numbers(self) -> set[str]:
        """Columns that hold numbers."""
        drives = [
            column
            for drive in self.drives
            for column in (drive.commanded, drive.measured)
        ]
        ends = [
            column
            for end in self.ends
            for kind in ("position", "axis", "quaternion", "euler")
            for column in getattr(end, kind) or ()
        ]
        others = [self.rows.time, self.join.key if self.join else None]
        return {column for column in (*drives, *ends, *others) if column is not None}

    @property
    def words(self) -> set[str]:
        """Columns that hold labels."""
        return {self.rows.label} if self.rows.label else set()


_TABLES = (LogMap, Source, Rows, Join, Drive, Pulled, End, Frame, KnownArm)
KEYS = tuple(name for table in _TABLES for name in table.model_fields)


def load_map(path: str | os.PathLike) -> LogMap:
    """Read a map.

    Raises:
        LogError: no such file, broken TOML, unknown key, impossible value.
    """
    return map_from_toml(read_text(path, LogError), str(path))


def map_from_toml(text: str, source: str = "map") -> LogMap:
    """Parse and check the text of a map; `source` names it in errors.

    Raises:
        LogError: broken TOML, unknown key, impossible value.
    """
    try:
        return LogMap.model_validate(toml_in(text))
    except ValidationError as error:
        raise LogError(explained(error, f"{source}: {HEADING}", KEYS)) from error
    except S2C2AError as error:
        raise LogError(f"{source}: {error}; mend that place") from error
