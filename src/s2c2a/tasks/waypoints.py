"""Waypoint tasks: paths from a table with the columns time, x, y and z.

The columns axis_x, axis_y, axis_z and module are optional. Lengths may have a unit in
their name, such as `x [mm]`.
"""

import csv
import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from math import isfinite
from pathlib import Path

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import interpolated
from s2c2a.arm.spec import MAX_MODULES
from s2c2a.errors import MAX_NAME_LENGTH, TargetError
from s2c2a.files.tables import METERS, SECONDS, parse_number, parse_rows, read_any_text
from s2c2a.files.text import LARGEST, MAX_BYTES, MAX_COUNT
from s2c2a.planning import SIGNIFICANT, Goal, reach_gaps
from s2c2a.runtime.border import check_meters
from s2c2a.tasks.task import Score, Task

REQUIRED = ("time", "x", "y", "z")
AXIS = ("axis_x", "axis_y", "axis_z")
OPTIONAL = (*AXIS, "module")


@dataclass(frozen=True)
class Waypoints:
    """Waypoints of one module's end.

    Attributes:
        module: its number, from 0 at the base; -1 is the tip.
        times: increasing times from the start of the task [s], shape (points,).
        positions: [m], base frame, shape (points, 3).
        axes: end axes, base frame, shape (points, 3); None for no desired orientation.
    """

    module: int
    times: Float[np.ndarray, " points"]
    positions: Float[np.ndarray, "points 3"]
    axes: Float[np.ndarray, "points 3"] | None


@dataclass(frozen=True)
class OutOfReach:
    """A waypoint out of reach.

    Attributes:
        module: its module.
        time: its time [s].
        gap: distance from the reachable set [m].
    """

    module: int
    time: float
    gap: float


def load_waypoints(path: str | os.PathLike) -> list[Waypoints]:
    """Read a table of waypoints, one track for each module in it.

    Raises:
        TargetError: no file, no waypoints, a missing or unknown column, a value that is
            no number, times that do not increase, or an axis of length zero.
    """
    table = read_table(Path(path), REQUIRED, OPTIONAL)
    if not table["time"].size:
        raise TargetError(
            f"{path} holds no waypoints; give at least one line of numbers below the "
            "column names"
        )
    modules = table.pop("module", np.full_like(table["time"], -1))
    names = list(dict.fromkeys(modules.tolist()))
    if len(names) > 2 * MAX_MODULES:
        raise TargetError(
            f"{path} names {len(names)} modules; an arm has at most {MAX_MODULES}"
        )
    tracks = []
    for module in names:
        rows = {name: column[modules == module] for name, column in table.items()}
        tracks.append(_track(path, int(module), rows))
    return tracks


def waypoints_task(name: str, tracks: Sequence[Waypoints], arm: ArmSpec) -> Task:
    """Linear interpolation of waypoints at the arm's control rate.

    Weights: mu_p = 1, mu_o = 2, mu_d = 0.5. The first waypoint holds from the start.

    Raises:
        TargetError: the arm does not have a module, a module has two tracks, the
            duration is too short or too long, or a position is so far away that it
            cannot be in meters.
    """
    _check_modules(name, tracks, arm)
    for track in tracks:
        check_meters(track.positions, arm, f"a waypoint of '{name}'")
    rate = arm.control_rate
    last = float(max((track.times[-1] for track in tracks), default=0.0))
    steps = last * rate + 1e-6
    if not 1 <= steps < MAX_COUNT + 1:
        raise TargetError(
            f"the waypoints of '{name}' end at {last:g} s; at {rate:g} Hz the last "
            f"time must lie between one step and {MAX_COUNT} steps after the start"
        )
    times = np.arange(1, int(steps) + 1) / rate
    base = Goal.of(arm.module_count, change_weight=0.5)
    positions = np.tile(base.positions, (len(times), 1, 1))
    axes = np.tile(base.axes, (len(times), 1, 1))
    scores: list[Score] = []
    # `with_position` and `with_axis` set the weights, and validate the largest values
    for track in tracks:
        desired = interpolated(times, track.times, track.positions)
        base = base.with_position(_extremes(desired)[0], 1.0, track.module)
        positions[:, track.module] = desired
        scores.append(Score("position", track.module))
        if track.axes is None:
            continue
        desired = interpolated(times, track.times, track.axes)
        for axis in _extremes(desired):
            base = base.with_axis(axis, 2.0, track.module)
        # unit vectors in single precision, as `Goal.with_axis` computes them
        vectors = desired.astype(np.float32)
        lengths = np.sqrt(np.vecdot(vectors, vectors))
        axes[:, track.module] = vectors / lengths[:, None]
        scores.append(Score("orientation", track.module))
    goals = [
        base._replace(positions=step_positions, axes=step_axes)
        for step_positions, step_axes in zip(positions, axes, strict=True)
    ]
    return Task(name, tuple(goals), tuple(scores))


def unreachable_waypoints(
    tracks: Sequence[Waypoints], arm: ArmSpec
) -> list[OutOfReach]:
    """Waypoints that a constant-curvature arm within its bend limits cannot reach."""
    unreachable = []
    for track in tracks:
        gaps = reach_gaps(arm, track.positions, track.module)
        for time, gap in zip(track.times, gaps, strict=True):
            if gap > SIGNIFICANT * arm.length:
                unreachable.append(OutOfReach(track.module, float(time), float(gap)))
    return unreachable


def read_table(
    path: Path, required: Sequence[str], optional: Sequence[str] = ()
) -> dict[str, np.ndarray]:
    """Read a table of numbers: columns by name, in SI units.

    Raises:
        TargetError: no file, a missing or unknown column or unit, or a value that is no
            number.
    """
    if not path.is_file():
        raise TargetError(
            f"no waypoints at {path}; give a table with the columns "
            f"{', '.join(required)}"
        )
    try:
        table = parse_rows(read_any_text(path, TargetError, MAX_BYTES))
        columns, scales = column_units(path, table.names)
        has_required = set(required) <= set(columns) <= {*required, *optional}
        has_whole_axis = len(set(AXIS) & set(columns)) in (0, 3)
        has_duplicates = len(set(columns)) < len(columns)
        if not has_required or not has_whole_axis or has_duplicates:
            raise TargetError(
                f"{path} has the columns {', '.join(columns) or 'none'}; it needs "
                f"{', '.join(REQUIRED)}, and may have {', '.join(AXIS)} (all three) "
                "and module, each once; a curve for the whole arm has x, y, z and no "
                "others"
            )
        rows = (
            _numbers(path, line, row, columns, table.decimal_comma)
            for line, row in table.rows
        )
        numbers = np.array(list(islice(rows, MAX_COUNT + 1)))
    except csv.Error as error:
        raise TargetError(
            f"{path} cannot be read as a table of text: {error}; quote no cells"
        ) from error
    numbers = numbers.reshape(-1, len(columns)) * scales
    if len(numbers) > MAX_COUNT:
        raise TargetError(
            f"{path} has more than {MAX_COUNT} lines; give fewer waypoints, the path "
            "between them is straight"
        )
    return dict(zip(columns, numbers.T, strict=True))


def column_units(
    path: Path, names: Sequence[str]
) -> tuple[list[str], Float[np.ndarray, " columns"]]:
    """Names of columns in small letters, and the SI value of the unit behind each.

    A unit stands in brackets or parentheses, such as `x [mm]`; without one, columns are
    in meters and seconds.

    Raises:
        TargetError: an unknown unit.
    """
    columns = []
    scales = []
    for name in names:
        column, _, unit = name.lower().replace("(", "[").partition("[")
        column = column.strip()
        unit = unit.strip(" )]")
        known = SECONDS if column == "time" else METERS
        if unit and (column in OPTIONAL or unit not in known):
            allowed = "none" if column in OPTIONAL else ", ".join(known)
            raise TargetError(
                f"{path}: '{name[:MAX_NAME_LENGTH]}' has the unit '{unit[:9]}'; write one "
                f"of these: {allowed}"
            )
        columns.append(column)
        scales.append(known[unit] if unit else 1.0)
    return columns, np.array(scales)


def _numbers(
    path: Path, line: int, row: list[str], columns: Sequence[str], decimal_comma: bool
) -> list[float]:
    found = [parse_number(cell, decimal_comma) for cell in row]
    numbers = [number for number in found if number is not None]
    if len(numbers) < len(found) or len(numbers) != len(columns):
        raise TargetError(
            f"{path}, line {line}: every column must hold one number, got {row!r:.200}"
        )
    module = numbers[columns.index("module")] if "module" in columns else -1
    if not all(map(isfinite, numbers)) or module % 1:
        raise TargetError(
            f"{path}, line {line}: numbers must be finite, and the module a whole "
            f"number, got {row!r:.200}"
        )
    return numbers


def _track(path, module: int, table: dict[str, np.ndarray]) -> Waypoints:
    times = table["time"]
    if times[0] < 0:
        raise TargetError(
            f"{path}: times count from the start of the task and are not negative, "
            f"got {times[0]:g}"
        )
    for step in np.flatnonzero(times[1:] <= times[:-1]):
        raise TargetError(
            f"{path}: the times of a module must rise, got {times[step + 1]:g} after "
            f"{times[step]:g}; for a jump, put the second row a control step later"
        )
    positions = np.stack([table[name] for name in ("x", "y", "z")], axis=-1)
    if AXIS[0] not in table:
        return Waypoints(module, times, positions, None)
    axes = np.stack([table[name] for name in AXIS], axis=-1)
    if np.abs(axes).max() > LARGEST:
        raise TargetError(
            f"{path}: an axis has numbers beyond {LARGEST:g}; give a shorter vector, "
            "since only its direction counts"
        )
    lengths = np.linalg.norm(axes, axis=-1)
    if not lengths.all():
        raise TargetError(
            f"{path}: an axis of length zero at time {times[lengths == 0][0]:g}; "
            "give a direction"
        )
    return Waypoints(module, times, positions, axes / lengths[:, None])


def _check_modules(name: str, tracks: Sequence[Waypoints], arm: ArmSpec) -> None:
    """Reject two tracks of one module; `Goal` rejects modules that do not exist.

    The tip has two numbers: -1 and that of the last module.
    """
    count = arm.module_count
    modules = [
        track.module % count for track in tracks if -count <= track.module < count
    ]
    if len(set(modules)) < len(modules):
        raise TargetError(
            f"the waypoints of '{name}' name a module of '{arm.name}' twice, by "
            f"{[track.module for track in tracks]}; -1 and {count - 1} are both its tip"
        )


def _extremes(vectors: np.ndarray) -> np.ndarray:
    """The vectors with the largest and the smallest maximum norm."""
    sizes = np.abs(vectors).max(axis=-1)
    return vectors[[sizes.argmax(), sizes.argmin()]]
