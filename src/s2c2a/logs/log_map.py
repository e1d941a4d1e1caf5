"""The map of a log: a TOML file that describes its columns, units, and frame."""

import os
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)

from s2c2a.arm.spec import MAX_MODULES, NAME, Number
from s2c2a.errors import S2C2AError, counted
from s2c2a.files.text import parse_toml, read_text
from s2c2a.files.validation import explained, key_names
from s2c2a.logs.errors import LogError

MAX_TEXT = 300
HEADING = "{faults} in the map (drives, ends, and modules count from 0)"
MAX_CABLES = 8 * MAX_MODULES
Column = Annotated[str, Field(min_length=1, max_length=200)]
Columns = tuple[Column, ...]
Vector = tuple[Number, Number, Number]
SIGNED_AXES = {f"{sign}{axis}" for sign in ("", "+", "-") for axis in "xyz"}


def _direction(axes: str) -> BeforeValidator:
    """Validator of a signed axis or a vector; `axes` explains x, y and z."""

    def check(value: Any) -> Any:
        if value is None or (isinstance(value, str) and value in SIGNED_AXES):
            return value
        if isinstance(value, list | tuple) and len(value) == 3:
            is_number = [type(part) in (int, float) for part in value]
            if all(is_number) and any(value):
                return value
        raise ValueError(
            f"{value!r:.100} is no direction; write x, y, z, -x, -y or -z, in quotes, "
            f"or a vector of three numbers in brackets; {axes}"
        )

    return BeforeValidator(check)


LogDirection = Annotated[
    str | Vector,
    _direction("x, y and z are the first, second and third column of `position`"),
]
BodyDirection = Annotated[
    str | Vector, _direction("x, y and z are the axes of the tracked frame")
]
ModuleIndex = Annotated[int, Field(ge=0, lt=MAX_MODULES)]
MapText = Annotated[str, Field(max_length=MAX_TEXT)]
SkippedLines = Annotated[int, Field(ge=0, le=1000)]
Scale = Annotated[Number, Field(gt=0, le=1e6)]
LengthUnit = Literal["mm", "cm", "m", "in", "ft"]
TimeUnit = Literal["s", "ms", "us", "ns", "min"] | Number
PressureUnit = Literal["Pa", "kPa", "MPa", "mbar", "bar", "psi"]
FORCE_UNITS = {"N": 1.0} | dict(
    Pa=1.0, kPa=1e3, MPa=1e6, mbar=100.0, bar=1e5, psi=6894.757
)
"""Newtons or pascals of a unit."""
ROTATING_UNITS = ("ticks", "deg", "rad", "turns")


def _actuation(unit: str) -> str:
    if unit in FORCE_UNITS:
        return "tension" if unit == "N" else "pressure"
    return "displacement"


class MapTable(BaseModel):
    """Immutable table, validated when built."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Source(MapTable):
    """Origin of a log; the recording keeps it.

    Attributes:
        name: robot and take.
        address: where the log is published.
        commit: version of the published log.
        license: license of the log.
    """

    name: MapText = ""
    address: MapText = ""
    commit: MapText = ""
    license: MapText = ""


class Rows(MapTable):
    """Timing of rows, and where episodes end.

    Attributes:
        kind: "timed": samples, resampled to the control rate; "steps": settled poses,
            one control step each.
        time: time column; without it, rows follow at `rate`.
        unit: unit of the time column, or its length in seconds. By default seconds, and
            for times since 1970 the unit that their size shows; time stamps need none.
        rate: row rate of a log without a time column [Hz].
        longest_gap: longest interval that is interpolated; a longer one ends an
            episode; estimated by default [s].
        label: text column whose changes end an episode.
        commands: "settled": rows are measured after their command has settled, the
            default of steps; "sent": before their command is sent, the default of timed
            rows.
        shortest: fewest steps of an episode; shorter ones are dropped.
        first_row: number of rows to skip at the beginning.
        rows: number of rows to read; all by default.
        skip_lines: number of lines above the header, or one for each joined file.
        topic: topic of a bag, or one for each joined file.
        broken_rows: whether an unreadable row is an error or a gap.
        outliers: whether poses that cannot be true, such as marker jumps, become
            unknown.
    """

    kind: Literal["timed", "steps"] = "timed"
    time: Column | None = None
    unit: TimeUnit | None = None
    rate: Number | None = Field(default=None, gt=0, le=1e5)
    longest_gap: Number | None = Field(default=None, gt=0, le=1e6)
    label: Column | None = None
    commands: Literal["settled", "sent"] | None = None
    shortest: int = Field(default=8, ge=2, le=100_000)
    first_row: int = Field(default=0, ge=0)
    rows: int | None = Field(default=None, ge=1)
    skip_lines: SkippedLines | tuple[SkippedLines, ...] = 0
    topic: Column | Columns | None = None
    broken_rows: Literal["refuse", "gap"] = "refuse"
    outliers: Literal["exclude", "keep"] = "exclude"

    @property
    def settled(self) -> bool:
        """Whether rows are measured after their command has settled."""
        if self.commands is None:
            return self.kind == "steps"
        return self.commands == "settled"

    @model_validator(mode="after")
    def _check_time(self):
        if self.kind == "timed" and (self.time is None) == (self.rate is None):
            raise ValueError(
                "timed rows need either a column (time) or a rate; "
                'add one of them, or set kind = "steps"'
            )
        return self


class Join(MapTable):
    """Files that form one take, with rows matched by a key or by time.

    Attributes:
        by: "key": rows with equal keys; "row": rows with equal numbers; "time": later
            files are interpolated at the times of the first one.
        key: column that every file has.
        files: number of files in a take, in the order of the command line.
        times: time column of each file; `rows.time` by default.
        units: unit of each file's time; `rows.unit` by default.
        offset: time of the first file's clock minus that of each later file [s];
            estimated, with the drift, from the motion of drives and ends by default.
    """

    by: Literal["key", "row", "time"] = "key"
    key: Column | None = None
    files: int = Field(default=2, ge=2, le=16)
    times: Columns | None = None
    units: tuple[TimeUnit, ...] | None = None
    offset: tuple[Number, ...] | None = None

    @model_validator(mode="after")
    def _check_method(self):
        if (self.by == "key") == (self.key is None):
            raise ValueError(
                "files are joined by equal keys, by time or row by row; give the column "
                '(key), or set by = "time" or "row" and leave key out'
            )
        if self.by != "time" and (self.times or self.units or self.offset is not None):
            raise ValueError('times, units and offset need by = "time"; set it')
        return self

    @model_validator(mode="after")
    def _check_counts(self):
        entries = (("times", self.times, 0), ("units", self.units, 0))
        for name, values, fewer in (*entries, ("offset", self.offset, 1)):
            expected = self.files - fewer
            if values is not None and len(values) != expected:
                raise ValueError(
                    f"{len(values)} {name} for {counted(self.files, 'file')}; give {expected}: "
                    + ("one for each later file" if fewer else "one for each file")
                )
        return self


class DrivenCable(MapTable):
    """Cable on a motor.

    Attributes:
        turn_deg: angle from the motor's direction to the cable [deg].
        sign: -1 if the motor releases this cable while it pulls.
    """

    turn_deg: Number = Field(default=0.0, ge=-360, le=360)
    sign: Literal[-1, 1] = 1


class Drive(MapTable):
    """Motor: its columns and its cables.

    Attributes:
        commanded: column of the commanded position, tension or pressure.
        measured: column of the measured position, tension or pressure.
        unit: unit of both columns; free: proportional to the bend, with a factor that
            is estimated.
        scale: factor of both columns, and of `offset`, to that unit.
        positive: effect of a larger number on the cable; estimated if unknown. A
            pressure always pushes ("releases").
        offset: value of the columns at rest, in their unit.
        module: module at which the cables end, 0 at the base; estimated by default.
        angle_deg: angle of the motor's direction; estimated by default [deg].
        cables: cables on the motor: one, an antagonistic pair, or more.
    """

    commanded: Column | None = None
    measured: Column | None = None
    unit: (
        LengthUnit | PressureUnit | Literal["ticks", "deg", "rad", "turns", "N", "free"]
    )
    scale: Scale = 1.0
    positive: Literal["pulls", "releases", "unknown"] = "unknown"
    offset: Number = 0.0
    module: ModuleIndex | None = None
    angle_deg: Number | None = Field(default=None, ge=-3600, le=3600)
    cables: tuple[DrivenCable, ...] = Field(
        default=(DrivenCable(),), min_length=1, max_length=8
    )

    @model_validator(mode="after")
    def _check_column(self):
        if self.commanded is None and self.measured is None:
            raise ValueError("name a column: commanded, measured, or both")
        if self.pushes and self.positive == "pulls":
            raise ValueError(
                f'a pressure in {self.unit} pushes; write positive = "releases", or '
                "leave it out"
            )
        return self

    @property
    def pushes(self) -> bool:
        """Whether the drive is the pressure of a chamber."""
        return _actuation(self.unit) == "pressure"

    @property
    def effect(self) -> Literal["pulls", "releases", "unknown"]:
        """Effect of a larger number, as stated or known from the unit."""
        return "releases" if self.pushes else self.positive

    @property
    def sign(self) -> int:
        """1 if a larger number pulls, -1 if it releases, 0 if that is unknown."""
        return {"pulls": 1, "releases": -1, "unknown": 0}[self.effect]

    @property
    def name(self) -> str:
        """The measured column, or the commanded one if there is none."""
        return self.measured or self.commanded or ""


class Body(MapTable):
    """Tracked body.

    Attributes:
        position: columns of x, y, z; of x, y where a camera sees a plane.
        unit: unit of the position.
        scale: factor of the position to that unit.
        quaternion: columns of a unit quaternion.
        order: order of the quaternion's columns.
        matrix: columns of a rotation matrix, row by row: from the tracked frame to that
            of the log.
        euler: columns of three Euler angles, or of one angle in the plane of x and y.
        sequence: axes of the Euler angles: "xyz" extrinsic, "XYZ" intrinsic, "z" of one.
        euler_unit: unit of the Euler angles.
    """

    position: Columns = Field(min_length=2, max_length=3)
    unit: LengthUnit
    scale: Scale = 1.0
    quaternion: tuple[Column, Column, Column, Column] | None = None
    order: Literal["xyzw", "wxyz"] | None = None
    matrix: Columns | None = Field(None, min_length=9, max_length=9)
    euler: Columns | None = None
    sequence: str | None = Field(default=None, pattern=r"^([xyz]{3}|[XYZ]{3}|z)$")
    euler_unit: Literal["deg", "rad"] = "deg"

    @model_validator(mode="before")
    @classmethod
    def _check_position(cls, values: Any) -> Any:
        if isinstance(values, dict) and "position" not in values:
            raise ValueError(
                "position is missing; name the columns of x, y and z, or of x and y in "
                "an image: angles alone do not show an arm's lengths"
            )
        return values

    @model_validator(mode="after")
    def _check_rotation(self):
        names = ("axis", "quaternion", "matrix", "euler")
        given = [name for name in names if name in self.model_fields_set]
        if len(given) > 1:
            raise ValueError(
                f"{' and '.join(given)} are given; give one of them, or none"
            )
        if (self.quaternion is None) != (self.order is None):
            raise ValueError(
                "quaternion and order belong together; give both, with "
                'order = "xyzw" or "wxyz", or neither'
            )
        if (self.euler is None) != (self.sequence is None):
            raise ValueError(
                "euler and sequence belong together; give both, with a sequence such "
                'as "xyz" (extrinsic) or "ZYX" (intrinsic), or neither'
            )
        if self.euler and len(self.euler) != len(self.sequence or ""):
            raise ValueError(
                f"euler has {counted(len(self.euler), 'column')} for the sequence "
                f'"{self.sequence}"; give one for each axis'
            )
        return self

    @property
    def rotation(self) -> tuple[str, ...]:
        """Columns of the rotation; none if it is not measured."""
        return self.quaternion or self.matrix or self.euler or ()

    @property
    def in_plane(self) -> bool:
        """Whether the body is measured in the plane of x and y alone."""
        return len(self.position) == 2


class End(Body):
    """Tracked end of a module.

    Attributes:
        module: module, 0 at the base; the last one by default.
        axis: columns of a vector along the arm, of as many coordinates as its position.
        along: direction along the arm in the tracked frame: "z", "-y", or a vector.
    """

    module: ModuleIndex | None = None
    axis: Columns | None = Field(None, min_length=2, max_length=3)
    along: BodyDirection = "z"

    @model_validator(mode="after")
    def _check_plane(self):
        if self.axis is not None and len(self.axis) != len(self.position):
            raise ValueError(
                f"axis has {counted(len(self.axis), 'column')} and position "
                f"{len(self.position)}; give as many coordinates of both"
            )
        along = self.along
        leaves = "z" in along if isinstance(along, str) else along[2] != 0
        if self.sequence == "z" and leaves:
            raise ValueError(
                "an angle in the plane of x and y leaves z as it is; state along, the "
                'direction along the arm at angle zero: "x", "-x", "y" or "-y"'
            )
        return self


class LogFrame(MapTable):
    """Frame in which positions are measured.

    Attributes:
        along: direction from the base to the tip of the straight arm: "z", "-y", or a
            vector, in the order of `position`; estimated by default.
        x: direction of the x axis of the base frame; an axis across the arm by default.
        base: position of the base; estimated by default [m].
        body: body on the base, relative to which ends are taken in every row, so that a
            base that moves is none; the other keys are then in its frame.
    """

    along: LogDirection | None = None
    x: LogDirection | None = None
    base: Vector | None = None
    body: Body | None = None


class KnownArm(MapTable):
    """Known properties of the arm; others are estimated or marked as guesses.

    Attributes:
        name: name of the arm.
        description: description in one line.
        modules: number of modules.
        control_rate: control rate [Hz].
        length: length of the straight arm; estimated by default [m].
        lengths: lengths of the modules from the base; equal by default [m].
        cable_radius: distance of the cables from the center line; estimated by default
            [m].
        pulley_radius: radius of the motors' pulleys, for ticks and angles [m].
        ticks_per_turn: encoder ticks per turn.
        gravity_direction: direction of gravity: [0, 0, -1] for an upright arm, [0, 0,
            1] for a hanging one.
        coupled_cables: whether cables of outer modules pass through inner modules and
            bend them; estimated by default.
        mass: mass of a module [kg].
        bending_stiffness: EI of a module [N m2].
        bend_limit_deg: bend limit; from the log by default [deg].
    """

    name: str = Field(pattern=NAME)
    description: str = ""
    modules: int = Field(ge=1, le=MAX_MODULES)
    control_rate: Number = Field(ge=0.01, le=1000)
    length: Number | None = Field(None, ge=0.005, le=20)
    lengths: tuple[Number, ...] | None = None
    cable_radius: Number | None = Field(None, ge=0.0015, le=0.3)
    pulley_radius: Number | None = Field(None, ge=0.0005, le=0.2)
    ticks_per_turn: int = Field(4096, ge=16, le=2**24)
    gravity_direction: Vector = (0.0, 0.0, -1.0)
    coupled_cables: bool | None = None
    mass: Number = 0.05
    bending_stiffness: Number = 0.1
    bend_limit_deg: Number | None = Field(None, ge=1, le=170)

    @model_validator(mode="after")
    def _check_lengths(self):
        if self.lengths is not None and len(self.lengths) != self.modules:
            raise ValueError(
                f"{len(self.lengths)} lengths for {counted(self.modules, 'module')}; "
                "give one for each module"
            )
        if self.lengths is not None and self.length is not None:
            raise ValueError("length and lengths are given; give one of them")
        return self


class LogMap(MapTable):
    """Description of a log.

    Attributes:
        source: origin of the log.
        rows: timing of rows, and where episodes end.
        join: files that form one take; each file is one by default.
        arm: known properties of the arm.
        drives: motors.
        ends: tracked ends of modules.
        frame: frame in which positions are measured.
    """

    source: Source = Source()
    rows: Rows
    join: Join | None = None
    arm: KnownArm
    drives: tuple[Drive, ...] = Field(min_length=1, max_length=MAX_CABLES)
    ends: tuple[End, ...] = Field(min_length=1, max_length=MAX_MODULES)
    frame: LogFrame = LogFrame()

    @model_validator(mode="after")
    def _check_modules(self):
        for key, entries in (("drives", self.drives), ("ends", self.ends)):
            modules = [entry.module or 0 for entry in entries]
            if max(modules) >= self.arm.modules:
                raise ValueError(
                    f"{key} name a module beyond the {self.arm.modules} of the arm; "
                    "modules count from 0 at the base"
                )
        modules = self.end_modules
        if len(set(modules)) < len(modules):
            raise ValueError(f"ends are of modules {modules}; each module has one end")
        columns = [column for end in self.ends for column in end.position]
        if len(set(columns)) < len(columns):
            raise ValueError(f"name each column of the ends once, not {columns}")
        return self

    @model_validator(mode="after")
    def _check_values_of_files(self):
        files = self.join.files if self.join else 1
        for key in ("skip_lines", "topic"):
            values = getattr(self.rows, key)
            if isinstance(values, tuple) and len(values) != files:
                raise ValueError(
                    f"{key} has {len(values)} values for {counted(files, 'joined file')}; "
                    "give one for each, or a single value"
                )
        return self

    @model_validator(mode="after")
    def _check_join(self):
        if self.join and self.join.by == "time" and self.rows.time is None:
            raise ValueError(
                "files are joined by time only with a time column; "
                'add rows.time, or join by = "key"'
            )
        return self

    @model_validator(mode="after")
    def _check_body(self):
        body = self.frame.body
        if body is None:
            return self
        is_turned_within = body.sequence == "z" or not body.rotation
        if any(end.in_plane != body.in_plane for end in self.ends) or (
            body.in_plane and not is_turned_within
        ):
            raise ValueError(
                "frame.body and the ends need as many coordinates; in a plane, its "
                'rotation is one angle (sequence = "z"), or not measured'
            )
        return self

    @model_validator(mode="after")
    def _check_units(self):
        units = {drive.unit for drive in self.drives}
        if units.intersection(ROTATING_UNITS) and self.arm.pulley_radius is None:
            raise ValueError(
                "columns in ticks or angles need arm.pulley_radius; "
                'add it, or set unit = "free" to have the factor estimated'
            )
        if "free" in units and self.arm.cable_radius is None:
            raise ValueError(
                'unit = "free" needs arm.cable_radius, on which the factor depends'
            )
        if len({_actuation(unit) for unit in units}) > 1:
            raise ValueError(
                f"the drives are in {' and '.join(sorted(units))}; an arm is driven by "
                "displacement, tension or pressure, and no two of them"
            )
        return self

    @property
    def actuation(self) -> str:
        """Actuation of the arm: "displacement", "tension" or "pressure"."""
        return _actuation(self.drives[0].unit)

    @property
    def by_force(self) -> bool:
        """Whether bends follow from forces, and no cable holds them."""
        return self.actuation != "displacement"

    @property
    def in_plane(self) -> bool:
        """Whether all ends are measured in the plane of x and y alone."""
        return all(end.in_plane for end in self.ends)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All tracked bodies: the ends, and that on the base if there is one."""
        return self.ends if self.frame.body is None else (*self.ends, self.frame.body)

    @property
    def end_modules(self) -> list[int]:
        """Modules whose ends are measured, in the order of `ends`."""
        last = self.arm.modules - 1
        return [last if end.module is None else end.module for end in self.ends]

    @property
    def number_columns(self) -> set[str]:
        """Names of the numeric columns."""
        columns: set[str | None] = {*self.time_columns}
        for drive in self.drives:
            columns |= {drive.commanded, drive.measured}
        for body in self.bodies:
            columns.update((*body.position, *body.rotation))
        for end in self.ends:
            columns.update(end.axis or ())
        return {column for column in columns if column is not None}

    @property
    def time_columns(self) -> set[str]:
        """Names of the columns that may hold time stamps."""
        keys = {self.rows.time}
        if self.join:
            keys |= {self.join.key, *(self.join.times or ())}
        return {key for key in keys if key is not None}

    @property
    def label_columns(self) -> set[str]:
        """Names of the text columns."""
        return {self.rows.label} if self.rows.label else set()


def load_map(path: str | os.PathLike) -> LogMap:
    """Read a map.

    Raises:
        LogError: the file does not exist, is not valid TOML, has an unknown key, or has
            a value out of range.
    """
    return map_from_toml(read_text(path, LogError), str(path))


def map_from_toml(text: str, source: str = "map") -> LogMap:
    """Parse and validate the text of a map; `source` names it in errors.

    Raises:
        LogError: the text is not valid TOML, has an unknown key, or has a value out of
            range.
    """
    try:
        return LogMap.model_validate(parse_toml(text))
    except ValidationError as error:
        heading = f"{source}: {HEADING}"
        raise LogError(explained(error, heading, key_names(LogMap))) from error
    except S2C2AError as error:
        raise LogError(f"{source}: {error}; correct that line") from error
