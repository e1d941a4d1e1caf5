"""A user's own path as a table: `time,x,y,z` and, where desired, `axis_x,axis_y,axis_z` and `module`."""

import csv
import io
import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from math import isfinite
from pathlib import Path

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.spec import MAX_MODULES
from s2c2a.errors import TargetError
from s2c2a.files import read_text
from s2c2a.goals import LARGEST
from s2c2a.planning import Goal, reach_gaps
from s2c2a.tasks.task import Score, Task

REQUIRED = ("time", "x", "y", "z")
AXIS = ("axis_x", "axis_y", "axis_z")
ALLOWED = (*REQUIRED, *AXIS, "module")
FAR = 0.01  # of the arm's length: gaps below it are not worth a word
LONGEST_STEPS = 1_000_000
MAX_LINES = 1_000_000
MAX_BYTES = 150_000_000


@dataclass(frozen=True)
class Waypoints:
    """Where one module's end shall be, and point, at some moments.

    Attributes:
        module: its number, from 0 at the base; -1 is the tip.
        times: [s] from the start of the task, rising, shape (points,).
        positions: [m], base frame, shape (points, 3).
        axes: end axes, base frame, shape (points, 3), or None where no orientation is
            asked for.
    """

    module: int
    times: Float[np.ndarray, " points"]
    positions: Float[np.ndarray, "points 3"]
    axes: Float[np.ndarray, "points 3"] | None


@dataclass(frozen=True)
class OutOfReach:
    """A waypoint that the arm cannot reach: its module and time [s], and what is missing [m]."""

    module: int
    time: float
    gap: float


def load_waypoints(path: str | os.PathLike) -> list[Waypoints]:
    """Read a table of comma-separated waypoints, one track for every module named in it.

    Raises:
        TargetError: no such file, no waypoint in it, a missing or unknown column,
            something that is no number, times that do not rise, an axis of length zero;
            the line or the time is named.
    """
    table = _read(Path(path))
    if not table["time"].size:
        raise TargetError(
            f"{path} holds no waypoints; give at least one line of numbers below the column names"
        )
    modules = table.pop("module", np.full_like(table["time"], -1))
    named = list(dict.fromkeys(modules.tolist()))
    if len(named) > 2 * MAX_MODULES:
        raise TargetError(
            f"{path} names {len(named)} modules; an arm has at most {MAX_MODULES}"
        )
    return [
        _track(
            path,
            int(module),
            {name: column[modules == module] for name, column in table.items()},
        )
        for module in named
    ]


def waypoints_task(name: str, tracks: Sequence[Waypoints], arm: ArmSpec) -> Task:
    """Straight lines between waypoints, at the arm's control rate. mu_p = 1, mu_o = 2, mu_d = 0.5.

    The first waypoint's target holds from the start.

    Raises:
        TargetError: a module that the arm has not, or that has two tracks; too short or
            too long a time.
    """
    _check_modules(name, tracks, arm)
    last = float(max((track.times[-1] for track in tracks), default=0.0))
    steps = last * arm.control_rate + 1e-6
    if not 1 <= steps < LONGEST_STEPS + 1:
        raise TargetError(
            f"the waypoints of '{name}' end at {last:g} s; at {arm.control_rate:g} Hz the last time must lie between "
            f"one step and {LONGEST_STEPS} steps after the start"
        )
    times = np.arange(1, int(steps) + 1) / arm.control_rate
    every = Goal.of(arm.module_count, change_weight=0.5)
    positions, axes = (
        np.tile(start, (len(times), 1, 1)) for start in (every.positions, every.axes)
    )
    scores: list[Score] = []
    for track in tracks:
        desired = _between(times, track.times, track.positions)
        # refused as any other goal would be
        every = every.with_position(_extremes(desired)[0], 1.0, track.module)
        positions[:, track.module] = desired
        scores.append(Score("position", track.module))
        if track.axes is not None:
            towards = _between(times, track.times, track.axes)
            for axis in _extremes(towards):
                every = every.with_axis(axis, 2.0, track.module)
            axes[:, track.module] = _unit(towards)
            scores.append(Score("orientation", track.module))
    goals = (
        every._replace(positions=here, axes=there)
        for here, there in zip(positions, axes, strict=True)
    )
    return Task(name, tuple(goals), tuple(scores))


def out_of_reach(tracks: Sequence[Waypoints], arm: ArmSpec) -> list[OutOfReach]:
    """The waypoints that a constant-curvature arm within its bend limits cannot bring its module's end to."""
    return [
        OutOfReach(track.module, float(time), float(gap))
        for track in tracks
        for time, gap in zip(
            track.times, reach_gaps(arm, track.positions, track.module), strict=True
        )
        if gap > FAR * arm.length
    ]


def _read(path: Path) -> dict[str, np.ndarray]:
    """The columns by name."""
    if not path.is_file():
        raise TargetError(
            f"no waypoints at {path}; give a table with the columns {', '.join(REQUIRED)}"
        )
    try:
        lines = csv.reader(
            io.StringIO(read_text(path, TargetError, MAX_BYTES), newline=""),
            skipinitialspace=True,
        )
        columns = [name.strip() for name in next(lines, ())]
        _check_columns(path, columns)
        rows = islice(
            (_numbers(path, lines.line_num, row, columns) for row in lines if row),
            MAX_LINES + 1,
        )
        numbers = np.array(list(rows)).reshape(-1, len(columns))
    except csv.Error as error:
        raise TargetError(
            f"{path} cannot be read as a table of text: {error}"
        ) from error
    if len(numbers) > MAX_LINES:
        raise TargetError(
            f"{path} has more than {MAX_LINES} lines; give fewer waypoints, the way between is straight"
        )
    return dict(zip(columns, numbers.T, strict=True))


def _check_columns(path: Path, columns: Sequence[str]) -> None:
    missing = [name for name in REQUIRED if name not in columns]
    unknown = [name for name in columns if name not in ALLOWED]
    some_axis = [name for name in AXIS if name in columns]
    if (
        missing
        or unknown
        or len(some_axis) not in (0, 3)
        or len(set(columns)) < len(columns)
    ):
        raise TargetError(
            f"{path} has the columns {', '.join(columns) or 'none'}; it needs {', '.join(REQUIRED)}, and may have "
            f"{', '.join(AXIS)} (all three) and module, each once"
        )


def _numbers(
    path: Path, line: int, row: list[str], columns: Sequence[str]
) -> list[float]:
    try:
        numbers = list(map(float, row))
        if len(numbers) != len(columns):
            raise ValueError("not as many as columns")
    except ValueError as error:
        raise TargetError(
            f"{path}, line {line}: every column must hold one number, got {row!r:.200}"
        ) from error
    if not all(map(isfinite, numbers)) or (
        "module" in columns and numbers[columns.index("module")] % 1
    ):
        raise TargetError(
            f"{path}, line {line}: numbers must be finite, and the module a whole number, got {row!r:.200}"
        )
    return numbers


def _track(path, module: int, table: dict[str, np.ndarray]) -> Waypoints:
    times = table["time"]
    if times[0] < 0:
        raise TargetError(
            f"{path}: times count from the start of the task and are not negative, got {times[0]:g}"
        )
    for step in np.flatnonzero(times[1:] <= times[:-1]):
        raise TargetError(
            f"{path}: the times of a module must rise, got {times[step + 1]:g} after {times[step]:g}"
        )
    positions = np.stack([table[name] for name in ("x", "y", "z")], axis=-1)
    if AXIS[0] not in table:
        return Waypoints(module, times, positions, None)
    axes = np.stack([table[name] for name in AXIS], axis=-1)
    if np.abs(axes).max() > LARGEST:
        raise TargetError(
            f"{path}: an axis has numbers beyond {LARGEST:g}; any length below will do"
        )
    lengths = np.linalg.norm(axes, axis=-1)
    if (lengths < 1e-9).any():
        raise TargetError(
            f"{path}: an axis of length zero at time {times[lengths < 1e-9][0]:g}; give a direction"
        )
    return Waypoints(module, times, positions, axes / lengths[:, None])


def _check_modules(name: str, tracks: Sequence[Waypoints], arm: ArmSpec) -> None:
    """Refuse two tracks for one module, which -1 and the last number are; goals refuse one that is not there."""
    count = arm.module_count
    modules = [
        track.module % count for track in tracks if -count <= track.module < count
    ]
    if len(set(modules)) < len(modules):
        raise TargetError(
            f"the waypoints of '{name}' name a module of '{arm.name}' twice, by {[track.module for track in tracks]}; "
            f"-1 and {count - 1} are both its tip"
        )


def _between(times: np.ndarray, moments: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(times, moments, column) for column in values.T], axis=-1)


def _extremes(vectors: np.ndarray) -> np.ndarray:
    """The longest and the shortest."""
    sizes = np.abs(vectors).max(axis=-1)
    return vectors[[sizes.argmax(), sizes.argmin()]]


def _unit(axes: np.ndarray) -> np.ndarray:
    """As `Goal.with_axis` does it, in single precision."""
    vectors = axes.astype(np.float32)
    return vectors / np.sqrt(np.vecdot(vectors, vectors))[:, None]
