"""A user's own path as a table: `time,x,y,z` and, where wanted, `axis_x,axis_y,axis_z` and `module`."""

import csv
import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import TargetError
from s2c2a.planning import Goal
from s2c2a.planning.reach import reach_gaps
from s2c2a.tasks.task import Score, Task

REQUIRED = ("time", "x", "y", "z")
AXIS = ("axis_x", "axis_y", "axis_z")
ALLOWED = (*REQUIRED, *AXIS, "module")
FAR = 0.01  # of the arm's length: gaps below it are not worth a word
LONGEST_STEPS = 1_000_000


@dataclass(frozen=True)
class Waypoints:
    """Where one module's end shall be, and point, at some moments.

    Attributes:
        module: its number, from 0 at the base; -1 is the tip.
        times: [s] from the start of the task, rising, shape (points,).
        positions: [m], base frame, shape (points, 3).
        axes: end axes, base frame, shape (points, 3), or None where no orientation is asked for.
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
        TargetError: no such file, no waypoint in it, a missing or unknown column, something that is no number, times
            that do not rise, an axis of length zero; the line or the time is named.
    """
    table = _read(Path(path))
    if not table:
        raise TargetError(f"{path} holds no waypoints; give at least one line of numbers below the column names")
    modules = dict.fromkeys(int(row.get("module", -1)) for row in table)
    return [_track(path, module, [row for row in table if int(row.get("module", -1)) == module]) for module in modules]


def waypoints_task(name: str, tracks: Sequence[Waypoints], arm: ArmSpec) -> Task:
    """Straight lines between waypoints, at the arm's control rate. mu_p = 1, mu_o = 2, mu_d = 0.5.

    The first waypoint's target holds from the start.

    Raises:
        TargetError: a module that the arm has not, or that has two tracks; too short or too long a time.
    """
    _check_modules(name, tracks, arm)
    last = float(max((track.times[-1] for track in tracks), default=0.0))
    steps = int(min(last * arm.control_rate + 1e-6, LONGEST_STEPS + 1))
    if not 1 <= steps <= LONGEST_STEPS:
        raise TargetError(
            f"the waypoints of '{name}' end at {last:g} s; at {arm.control_rate:g} Hz the last time must lie between "
            f"one step and {LONGEST_STEPS} steps after the start"
        )
    times = np.arange(1, steps + 1) / arm.control_rate
    goals = [Goal.of(arm.module_count, change_weight=0.5)] * steps
    scores: list[Score] = []
    for track in tracks:
        goals = [
            goal.with_position(position, 1.0, track.module)
            for goal, position in zip(goals, _between(times, track.times, track.positions), strict=True)
        ]
        scores.append(Score("position", track.module))
        if track.axes is not None:
            axes = _between(times, track.times, track.axes)
            goals = [goal.with_axis(axis, 2.0, track.module) for goal, axis in zip(goals, axes, strict=True)]
            scores.append(Score("orientation", track.module))
    return Task(name, tuple(goals), tuple(scores))


def out_of_reach(tracks: Sequence[Waypoints], arm: ArmSpec) -> list[OutOfReach]:
    """The waypoints that a constant-curvature arm within its bend limits cannot bring its module's end to."""
    found = []
    for track in tracks:
        gaps = reach_gaps(arm, track.positions, track.module)
        far = np.flatnonzero(gaps > FAR * arm.length)
        found += [OutOfReach(track.module, float(track.times[i]), float(gaps[i])) for i in far]
    return found


def _read(path: Path) -> list[dict[str, float]]:
    if not path.is_file():
        raise TargetError(f"no waypoints at {path}; give a table with the columns {', '.join(REQUIRED)}")
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            reader.fieldnames = [name.strip() for name in reader.fieldnames or ()]
            _check_columns(path, reader.fieldnames)
            return [_numbers(path, reader.line_num, row) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise TargetError(f"{path} cannot be read as a table of text: {error}") from error


def _check_columns(path: Path, columns: Sequence[str]) -> None:
    missing = [name for name in REQUIRED if name not in columns]
    unknown = [name for name in columns if name not in ALLOWED]
    some_axis = [name for name in AXIS if name in columns]
    if missing or unknown or len(some_axis) not in (0, 3) or len(set(columns)) < len(columns):
        raise TargetError(
            f"{path} has the columns {', '.join(columns) or 'none'}; it needs {', '.join(REQUIRED)}, and may have "
            f"{', '.join(AXIS)} (all three) and module, each once"
        )


def _numbers(path: Path, line: int, row: dict) -> dict[str, float]:
    try:
        numbers = {name: float(value) for name, value in row.items()}
    except (TypeError, ValueError) as error:
        raise TargetError(f"{path}, line {line}: every column must hold one number, got {row}") from error
    whole = numbers.get("module", -1.0)
    if not np.isfinite(list(numbers.values())).all() or whole != int(whole):
        raise TargetError(f"{path}, line {line}: numbers must be finite, and the module a whole number, got {row}")
    return numbers


def _track(path, module: int, rows: list[dict[str, float]]) -> Waypoints:
    times = np.array([row["time"] for row in rows])
    if times[0] < 0:
        raise TargetError(f"{path}: times count from the start of the task and are not negative, got {times[0]:g}")
    for before, after in pairwise(times):
        if after <= before:
            raise TargetError(f"{path}: the times of a module must rise, got {after:g} after {before:g}")
    positions = np.array([[row[name] for name in ("x", "y", "z")] for row in rows])
    if AXIS[0] not in rows[0]:
        return Waypoints(module, times, positions, None)
    axes = np.array([[row[name] for name in AXIS] for row in rows])
    lengths = np.linalg.norm(axes, axis=-1)
    if (lengths < 1e-9).any():
        raise TargetError(f"{path}: an axis of length zero at time {times[lengths < 1e-9][0]:g}; give a direction")
    return Waypoints(module, times, positions, axes / lengths[:, None])


def _check_modules(name: str, tracks: Sequence[Waypoints], arm: ArmSpec) -> None:
    """Refuse two tracks for one module, which -1 and the last number are; goals refuse one that is not there."""
    count = arm.module_count
    modules = [track.module % count for track in tracks if -count <= track.module < count]
    if len(set(modules)) < len(modules):
        raise TargetError(
            f"the waypoints of '{name}' name a module of '{arm.name}' twice, by {[track.module for track in tracks]}; "
            f"-1 and {count - 1} are both its tip"
        )


def _between(times: np.ndarray, moments: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(times, moments, column) for column in values.T], axis=-1)
