"""Shape tasks: the whole arm takes the shape of a curve, and holds it.

The curve is a table with the columns x, y and z: its points from base to tip.
"""

import csv
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import interpolated
from s2c2a.errors import TargetError, counted
from s2c2a.files.tables import parse_rows, read_any_text
from s2c2a.runtime.border import check_meters
from s2c2a.spaces import CENTER_LINE_POINTS
from s2c2a.tasks.circle import APPROACH_TIME, ROUND_TIME
from s2c2a.tasks.task import Score, Task
from s2c2a.tasks.waypoints import (
    MAX_BYTES,
    Waypoints,
    column_units,
    load_waypoints,
    read_table,
    waypoints_task,
)

COLUMNS = ("x", "y", "z")
TOLERANCE = 0.05  # of the arm's length; chosen: a drawn curve misses base or tip by it

Curve = Float[np.ndarray, "points 3"]
"""Points of a center line from base to tip [m], base frame, straight between them."""


def table_task(path: str | os.PathLike, arm: ArmSpec) -> Task:
    """Return the task of a table: waypoints, or a curve if it has no times.

    Raises:
        TargetError: see `load_waypoints`, `waypoints_task`, `load_curve`, `shape_task`.
    """
    name = Path(path).stem
    if is_curve(path):
        return shape_task(name, load_curve(path), arm)
    return waypoints_task(name, load_waypoints(path), arm)


def is_curve(path: str | os.PathLike) -> bool:
    """Whether the header of a table has the columns of a curve, and no others.

    Raises:
        TargetError: the file cannot be read.
    """
    if not Path(path).is_file():
        return False  # the reader of waypoints says what is missing
    text = read_any_text(path, TargetError, MAX_BYTES)
    try:
        names = parse_rows(text).names
    except csv.Error:
        return False  # the same
    return sorted(column_units(Path(path), names)[0]) == [*COLUMNS]


def load_curve(path: str | os.PathLike) -> Curve:
    """Read the points of a curve from a table with the columns x, y and z.

    Raises:
        TargetError: no file, other columns, or a value that is no finite number.
    """
    table = read_table(Path(path), COLUMNS)
    return np.stack([table[name] for name in COLUMNS], axis=-1)


def shape_task(name: str, points: Curve, arm: ArmSpec) -> Task:
    """Take the shape of a curve with the whole arm, and hold it for 20 s.

    Every module has the point of the curve at the arc length of its end as its desired
    position, and the tangent there as its axis. Sensors and trackers measure these, so
    that feedback corrects them; bends (`Goal.shape`) are those of the model, and have
    its error. Weights: mu_p = 1, mu_o = 2, mu_d = 0.5.

    Args:
        name: of the task.
        points: of the curve, from base to tip [m], base frame.
        arm: the arm; a longer curve is followed as far as the arm goes.

    Raises:
        TargetError: fewer than three points, coordinates that cannot be meters, a curve
            that does not begin at the base or is shorter than the arm, or a sharp bend.
    """
    curve = _checked_curve(name, points, arm)
    lengths = ArmGeometry.of(arm).lengths
    # a curve that is a little too short is followed in proportion
    ends = np.cumsum(lengths) * min(1.0, _arc_lengths(curve)[-1] / arm.length)
    half = lengths / (2 * CENTER_LINE_POINTS)
    positions = _at(curve, ends)
    axes = _at(curve, ends + half) - _at(curve, ends - half)
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    time = np.array([APPROACH_TIME + ROUND_TIME])
    tracks = [
        Waypoints(module, time, positions[[module]], axes[[module]])
        for module in range(arm.module_count)
    ]
    task = waypoints_task(name, tracks, arm)
    scores = Score("shape"), Score("end distance")
    return replace(task, scores=scores, curve=curve)


def _arc_lengths(curve: Curve) -> Float[np.ndarray, " points"]:
    """Arc lengths of the points from the base [m]."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=-1)))


def _at(curve: Curve, lengths: Float[np.ndarray, " ends"]) -> np.ndarray:
    """Points at arc lengths [m]; the last one beyond the end."""
    return interpolated(lengths, _arc_lengths(curve), curve)


def _checked_curve(name: str, points: Curve, arm: ArmSpec) -> Curve:
    """The curve with the base as its first point, without repeated points."""
    if len(points) < 3:
        raise TargetError(
            f"the curve '{name}' has {counted(len(points), 'point')}; give at least "
            "three, from base to tip, better one every few centimeters"
        )
    check_meters(points, arm, f"the curve '{name}'")
    gap = np.linalg.norm(points[0])
    if gap > TOLERANCE * arm.length:
        raise TargetError(
            f"the curve '{name}' begins {100 * gap:.1f} cm from the base; begin it at "
            "the base, 0,0,0, and list its points from base to tip"
        )
    curve = np.concatenate([np.zeros((1, 3)), points[1:]])
    curve = curve[np.append(True, np.diff(curve, axis=0).any(axis=-1))]
    length = _arc_lengths(curve)[-1]
    if length < (1.0 - TOLERANCE) * arm.length:
        raise TargetError(
            f"the curve '{name}' is {length:.3g} m long, and '{arm.name}' "
            f"{arm.length:.3g} m; give a curve for the whole arm, or a position and an "
            "axis of one module as waypoints"
        )
    # refuse a turn within some centimeters that is more than a whole module bends
    geometry = ArmGeometry.of(arm)
    step = geometry.lengths.min() / CENTER_LINE_POINTS
    below = np.concatenate([[[0.0, 0.0, -step]], curve])  # the base points along z
    knots = _arc_lengths(below)
    corners = knots[(knots >= step) & (knots <= knots[-1] - step)]
    before = _at(below, corners) - _at(below, corners - step)
    after = _at(below, corners + step) - _at(below, corners)
    crosses = np.linalg.norm(np.cross(before, after), axis=-1)
    turns = np.arctan2(crosses, np.vecdot(before, after))
    sharpest = int(turns.argmax())
    limit = geometry.bend_limits.max()
    if turns[sharpest] > limit:
        x, y, z = _at(below, corners[[sharpest]])[0]
        raise TargetError(
            f"the curve '{name}' turns by {np.rad2deg(turns[sharpest]):.0f} deg at "
            f"{x:.3g},{y:.3g},{z:.3g}, and a whole module of '{arm.name}' by at most "
            f"{np.rad2deg(limit):.0f} deg; begin along z, and give a wider bend, or more "
            "points where the curve bends"
        )
    return curve
