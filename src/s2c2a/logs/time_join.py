"""Files of one take with clocks of their own, joined at the times of the first."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from s2c2a.logs.body_poses import as_rotations, positions_of, stacked, unturned
from s2c2a.logs.clocks import LogClock, estimate_clock
from s2c2a.logs.errors import LogError
from s2c2a.logs.interpolation import interpolate, is_near
from s2c2a.logs.log_map import Body, LogMap
from s2c2a.logs.row_times import row_times
from s2c2a.logs.tables import Table, check_distinct
from s2c2a.logs.timed_motion import TimedMotion

# default longest gap, in median row intervals of a file
DEFAULT_GAP = 4.0
TIME = ""
"""Name of the time column of each file while files are joined; maps cannot use it."""


def join_by_time(
    tables: Sequence[Table], log_map: LogMap
) -> tuple[Table, tuple[LogClock, ...]]:
    """Interpolate later files at the times of the first one.

    Args:
        tables: files of a take.
        log_map: the map, which joins by time.

    Returns:
        The joined table, with the clock of the first file, and the clocks of later
        files.

    Raises:
        LogError: a file lacks its time column, times fall, columns occur twice, or the
            motion does not determine an offset that is not stated.
    """
    join = log_map.join
    assert join is not None
    assert log_map.rows.time is not None
    columns = join.times or (log_map.rows.time,) * len(tables)
    units = join.units or (log_map.rows.unit,) * len(tables)
    first, *later = map(_sort_out_times, tables, columns, units)
    check_distinct([first, *later], TIME)
    times = first.numbers[TIME]
    numbers = {name: column for name, column in first.numbers.items() if name != TIME}
    numbers[log_map.rows.time] = times
    labels = dict(first.labels)
    clocks = []
    for index, table in enumerate(later, 1):
        own_times = table.numbers[TIME]
        clock = _find_clock(first, times, table, own_times, index, log_map)
        converted = clock.convert(own_times)
        numbers |= _resample_numbers(table, converted, times, log_map)
        labels |= _resample_labels(table, converted, times)
        clocks.append(clock)
    path = " + ".join(table.path for table in tables)
    broken_rows = sum(table.broken_rows for table in tables)
    in_seconds = frozenset([log_map.rows.time])
    return Table(path, numbers, labels, broken_rows, in_seconds), tuple(clocks)


def _sort_out_times(table: Table, column: str, unit: str | float | None) -> Table:
    """Rows with a time, the first of equal ones; the time column is renamed, in seconds.

    Raises:
        LogError: the column is missing, times fall, or fewer than two are left.
    """
    if column not in table.numbers:
        raise LogError(
            f"{table.path} lacks the time column '{column}'; name that of each file in "
            "join.times"
        )
    times = row_times(table, column, unit)
    known = np.flatnonzero(np.isfinite(times))
    falls = np.flatnonzero(np.diff(times[known]) < 0)
    if len(falls):
        row = known[falls[0]]
        raise LogError(
            f"{table.path}: '{column}' falls after row {row}; sort the rows, or split "
            "the file where the clock was set back"
        )
    known = known[np.diff(times[known], prepend=-np.inf) > 0]
    if len(known) < 2:
        raise LogError(
            f"{table.path}: '{column}' has {len(known)} different times; at least two "
            "are needed"
        )
    rows = table.select(known)
    numbers = {name: value for name, value in rows.numbers.items() if name != column}
    numbers[TIME] = times[known]
    return replace(rows, numbers=numbers)


def _find_clock(
    first: Table,
    times: np.ndarray,
    later: Table,
    later_times: np.ndarray,
    index: int,
    log_map: LogMap,
) -> LogClock:
    """Stated clock, or the one that the motion of drives and ends determines."""
    join = log_map.join
    if join is not None and join.offset is not None:
        middle = float(later_times.mean())
        return LogClock(float(join.offset[index - 1]), middle=middle)
    try:
        drives = _drive_motion(first, times, log_map)
        ends = _end_motion(later, later_times, log_map)
        if drives and ends:
            return estimate_clock(drives, ends)
        ends = _end_motion(first, times, log_map)
        drives = _drive_motion(later, later_times, log_map)
        if drives and ends:
            return estimate_clock(drives, ends).inverted()
    except LogError as error:
        raise LogError(f"{first.path} and {later.path}: {error}") from error
    raise LogError(
        f"{first.path} and {later.path}: the offset between the clocks is estimated "
        "only between drives in one file and ends in the other; state join.offset"
    )


def _drive_motion(
    table: Table, times: np.ndarray, log_map: LogMap
) -> TimedMotion | None:
    """Motion of the drives that the table has, measured if it is; None if it has none."""
    columns = [(drive.measured, drive.commanded) for drive in log_map.drives]
    measured = [first for first, _ in columns if first]
    used = measured or [second for _, second in columns if second]
    return _motion(
        times, [table.numbers[name] for name in used if name in table.numbers]
    )


def _end_motion(table: Table, times: np.ndarray, log_map: LogMap) -> TimedMotion | None:
    """Motion of the ends that the table has; None if it has none.

    That of a base which carries a body is no motion of the drives.
    """
    has = table.numbers.keys()
    ends = [positions_of(table, end) for end in log_map.ends if has >= {*end.position}]
    if not ends:
        return None
    positions = np.stack(ends, axis=1)
    body = log_map.frame.body
    if body is not None and has >= {*body.position, *body.rotation}:
        away = positions - positions_of(table, body)[:, None]
        (positions,) = unturned(table, body, away)
    return _motion(times, list(positions.reshape(len(table), -1).T))


def _motion(times: np.ndarray, columns: list[np.ndarray]) -> TimedMotion | None:
    """Rows with all columns; None if there are none."""
    # an end that is never measured hides no other
    present = [column for column in columns if np.isfinite(column).any()]
    if not present:
        return None
    values = np.stack(present, axis=1)
    known = np.isfinite(values).all(axis=1)
    return TimedMotion(times[known], values[known])


def _resample_numbers(
    table: Table, times: np.ndarray, samples: np.ndarray, log_map: LogMap
) -> dict[str, np.ndarray]:
    """Columns at other times; NaN beyond the longest gap; rotations stay rotations."""
    limit = log_map.rows.longest_gap
    if limit is None:
        limit = DEFAULT_GAP * float(np.median(np.diff(times)))
    columns = {
        name: interpolate(times, column[:, None], samples, limit)[:, 0]
        for name, column in table.numbers.items()
        if name != TIME
    }
    for body in log_map.bodies:
        if body.rotation and set(body.rotation) <= set(columns):
            columns |= _resample_rotation(table, body, times, samples, limit)
    return columns


def _resample_rotation(
    table: Table,
    body: Body,
    times: np.ndarray,
    samples: np.ndarray,
    limit: float,
) -> dict[str, np.ndarray]:
    """Columns of a body's rotation, by spherical interpolation."""
    names = body.rotation
    values = stacked(table, names)
    known = np.isfinite(values).all(axis=1)
    if not body.euler:  # zeros mark poses that were not measured
        known &= np.abs(values).sum(axis=1) > 0
    result = np.full((len(samples), len(names)), np.nan)
    if known.sum() > 1:
        times = times[known]
        near = (samples >= times[0]) & (samples <= times[-1])
        near &= is_near(times, samples, limit)
        along_arc = Slerp(times, as_rotations(values[known], body))
        result[near] = _as_columns(along_arc(samples[near]), body)
    return dict(zip(names, result.T, strict=True))


def _as_columns(rotations: Rotation, body: Body) -> np.ndarray:
    """Numbers of rotations, in the order of a body's columns."""
    if body.quaternion:
        return rotations.as_quat(scalar_first=body.order == "wxyz")
    if body.matrix:
        return rotations.as_matrix().reshape(-1, 9)
    degrees = body.euler_unit == "deg"
    if body.sequence == "z":
        return rotations.as_rotvec(degrees=degrees)[:, 2:]
    return rotations.as_euler(body.sequence or "", degrees=degrees)


def _resample_labels(
    table: Table, times: np.ndarray, samples: np.ndarray
) -> dict[str, np.ndarray]:
    """Labels of the last row at or before each time."""
    rows = (np.searchsorted(times, samples, side="right") - 1).clip(0)
    return {name: column[rows] for name, column in table.labels.items()}
