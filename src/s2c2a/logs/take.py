"""Takes: the contents of a log in SI units, in the frame of the log."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from jaxtyping import Float

from s2c2a.errors import counted
from s2c2a.files.tables import METERS
from s2c2a.logs.body_poses import positions_of, rotations_of, unturned, vectors_of
from s2c2a.logs.clocks import LogClock
from s2c2a.logs.errors import LogError
from s2c2a.logs.log_map import (
    FORCE_UNITS,
    ROTATING_UNITS,
    Body,
    Drive,
    End,
    LogMap,
    Vector,
)
from s2c2a.logs.row_times import row_times
from s2c2a.logs.tables import Table, check_distinct, list_names, prefix_advice
from s2c2a.logs.time_join import join_by_time
from s2c2a.measurements.frozen_ends import find_frozen

Drives = Float[np.ndarray, "rows drives"]
Ends = Float[np.ndarray, "rows ends 3"]
ROW = ""  # key of row numbers, which no map can name


@dataclass(frozen=True)
class LogTake:
    """Rows of one log.

    Attributes:
        time: time [s], increasing where it is a number, shape (rows,).
        commanded: commands of the drives [m, N or free], positive as in the file, shape
            (rows, drives); NaN: unknown.
        measured: measured values of the drives, with the same units and shape.
        positions: positions of the ends [m], frame of the log, shape (rows, ends, 3);
            NaN: not measured.
        axes: unit vectors along the arm at the ends, same frame and shape.
        labels: text, shape (rows,); empty where the map names no label.
        broken_rows: number of unreadable rows.
        clocks: clocks of later files, if files are joined by time.
    """

    time: Float[np.ndarray, " rows"]
    commanded: Drives
    measured: Drives
    positions: Ends
    axes: Ends
    labels: np.ndarray
    broken_rows: int = 0
    clocks: tuple[LogClock, ...] = ()

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.time)

    @property
    def commands(self) -> Drives:
        """Commands, or the measured values of drives that have no command."""
        known = np.isfinite(self.commanded).any(axis=0)
        return np.where(known, self.commanded, self.measured)


def build_take(tables: Sequence[Table], log_map: LogMap) -> LogTake:
    """Convert the tables of one take, joined if there are several.

    Raises:
        LogError: a column is missing, or the files have no rows in common.
    """
    for each in tables:
        _check_length_unit(each, log_map)
    table, clocks = _join(tables, log_map)
    table = _select_rows(table, log_map)
    # a time column ends with the join, or is the time of all files
    joined = set(log_map.join.times or ()) if log_map.join else set()
    missing = log_map.number_columns - joined - set(table.numbers)
    missing |= log_map.label_columns - set(table.labels)
    if missing:
        others = {name for each in tables for name in each.available}
        others -= {*table.numbers, *table.labels}
        raise LogError(
            f"{table.path} lacks columns that the map names: "
            f"{list_names(sorted(missing))}; it has others: {list_names(sorted(others))}"
            f"{prefix_advice(missing)}"
        )
    positions = np.stack([positions_of(table, end) for end in log_map.ends], axis=1)
    axes = np.stack([_axes(table, end) for end in log_map.ends], axis=1)
    label = log_map.rows.label
    take = LogTake(
        _time(table, log_map),
        _drive_values(table, log_map, "commanded"),
        _drive_values(table, log_map, "measured"),
        positions,
        axes,
        table.labels[label] if label else np.full(len(table), ""),
        table.broken_rows,
        clocks,
    )
    body = log_map.frame.body
    return take if body is None else _relative_to(body, take, table, log_map)


def _time(table: Table, log_map: LogMap) -> np.ndarray:
    """Time of each row [s]; row number over rate where the log has no time column."""
    rows = log_map.rows
    if rows.time is None:
        rate = rows.rate or log_map.arm.control_rate
        return np.arange(len(table), dtype=float) / rate
    return row_times(table, rows.time, rows.unit)


def _check_length_unit(table: Table, log_map: LogMap) -> None:
    """Refuse bodies in another unit than the file states."""
    for body in log_map.bodies:
        is_there = not set(body.position).isdisjoint(table.numbers)
        if is_there and table.length_unit not in ("", body.unit) and body.scale == 1.0:
            raise LogError(
                f"{table.path} states lengths in {table.length_unit}, and the map "
                f'{body.unit}; write unit = "{table.length_unit}" for the body '
                f"'{body.position[0]}'"
            )


def _select_rows(table: Table, log_map: LogMap) -> Table:
    begin = log_map.rows.first_row
    count = log_map.rows.rows
    end = None if count is None else begin + count
    selected = table.select(np.arange(len(table))[begin:end])
    if len(selected) < 2:
        raise LogError(
            f"{table.path} has {counted(len(selected), 'row')} from row {begin} on; "
            "at least two are needed"
        )
    return selected


def _join(
    tables: Sequence[Table], log_map: LogMap
) -> tuple[Table, tuple[LogClock, ...]]:
    """Table of all files of a take, and the clocks of those joined by time."""
    if log_map.join is None:
        return tables[0], ()
    if log_map.join.by == "time":
        return join_by_time(tables, log_map)
    if log_map.join.key is not None:
        return _join_by_key(tables, log_map.join.key), ()
    counts = [len(table) for table in tables]
    if len(set(counts)) > 1:
        told = [f"{table.path} has {counted(len(table), 'row')}" for table in tables]
        raise LogError(
            f'{", ".join(told)}; by = "row" needs as many in each: '
            "correct rows.skip_lines if a header counts as a row, or a row as a header; "
            "else join by a key or by time"
        )
    numbered = [
        replace(table, numbers={**table.numbers, ROW: np.arange(len(table))})
        for table in tables
    ]
    return _join_by_key(numbered, ROW), ()


def _join_by_key(tables: Sequence[Table], key: str) -> Table:
    """Rows whose key occurs in every table, sorted by the key."""
    for table in tables:
        if key not in table.numbers:
            raise LogError(
                f"{table.path} lacks the column '{key}' that joins the files"
            )
        keys = table.numbers[key]
        is_blank = np.isnan(keys).any()
        if is_blank or len(np.unique(keys)) < len(keys):
            raise LogError(
                f"{table.path}: '{key}' has blank or duplicate values; "
                "each row needs its own number"
            )
    common = reduce(np.intersect1d, [table.numbers[key] for table in tables])
    if not len(common):
        paths = " and ".join(table.path for table in tables)
        raise LogError(f"{paths} have no '{key}' in common")
    check_distinct(tables, key)
    numbers: dict[str, np.ndarray] = {}
    labels: dict[str, np.ndarray] = {}
    for table in tables:
        keys = table.numbers[key]
        _, places, _ = np.intersect1d(keys, common, return_indices=True)
        rows = table.select(places)
        numbers |= rows.numbers
        labels |= rows.labels
    path = " + ".join(table.path for table in tables)
    broken_rows = sum(table.broken_rows for table in tables)
    stamps = frozenset().union(*(table.stamps for table in tables))
    return Table(path, numbers, labels, broken_rows, stamps)


def _drive_values(table: Table, log_map: LogMap, attribute: str) -> np.ndarray:
    values = []
    for drive in log_map.drives:
        column = getattr(drive, attribute)
        if column is None:
            values.append(np.full(len(table), np.nan))
            continue
        scale = drive_scale(drive, log_map)
        values.append((table.numbers[column] - drive.offset) * scale)
    return np.stack(values, axis=1)


def effective_drives(take: LogTake, log_map: LogMap) -> Drives:
    """Values of the drives while each row was measured."""
    commands = take.commands
    if not log_map.rows.settled:
        commands = np.concatenate([commands[:1], commands[:-1]])
    return np.where(np.isfinite(take.measured), take.measured, commands)


def drive_scale(drive: Drive, log_map: LogMap) -> float:
    """Meters, newtons or pascals per unit of a drive's columns; 1 for free units."""
    if drive.unit not in ROTATING_UNITS:
        units = METERS | FORCE_UNITS
        return drive.scale * units.get(drive.unit, 1.0)
    radians = {
        "turns": 2 * np.pi,
        "ticks": 2 * np.pi / log_map.arm.ticks_per_turn,
        "deg": np.pi / 180,
        "rad": 1.0,
    }
    return drive.scale * radians[drive.unit] * (log_map.arm.pulley_radius or 0.0)


def _axes(table: Table, end: End) -> np.ndarray:
    """Unit vectors along the arm, NaN where they are not measured, shape (rows, 3)."""
    if end.axis is not None:
        vectors = vectors_of(table, end.axis)
        lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
        unknown = np.full(vectors.shape, np.nan)
        return np.divide(vectors, lengths, out=unknown, where=lengths > 0)
    axes = np.full((len(table), 3), np.nan)
    if end.rotation:
        known, rotations = rotations_of(table, end)
        axes[known] = rotations.apply(unit_vector(end.along))
    return axes


def _relative_to(body: Body, take: LogTake, table: Table, log_map: LogMap) -> LogTake:
    """The take in the frame of a body; frozen poses go first, since its noise hides them."""
    positions = take.positions.copy()
    axes = take.axes.copy()
    if log_map.rows.outliers != "keep":
        drives = effective_drives(take, log_map)
        for end in range(len(log_map.ends)):
            pose = np.hstack([positions[:, end], axes[:, end]])
            is_frozen = find_frozen(drives, pose, np.zeros(len(take), int))
            positions[is_frozen, end] = np.nan
            axes[is_frozen, end] = np.nan
    positions -= positions_of(table, body)[:, None]
    positions, axes = unturned(table, body, positions, axes)
    return replace(take, positions=positions, axes=axes)


def unit_vector(direction: str | Vector) -> Float[np.ndarray, "3"]:
    """Unit vector of a signed axis such as `-y`, or of three numbers.

    Raises:
        LogError: the direction is neither of these, or the vector is zero.
    """
    if isinstance(direction, str):
        axis = direction[-1:]
        sign = direction[:-1]
        if axis not in ("x", "y", "z") or sign not in ("", "+", "-"):
            raise LogError(
                f"'{direction}' is not a direction; write an axis such as x or -y, "
                "or three numbers"
            )
        return (-1.0 if sign == "-" else 1.0) * np.eye(3)["xyz".index(axis)]
    length = float(np.linalg.norm(direction))
    if not length > 0:
        raise LogError(f"{list(direction)} has no length; give a direction")
    return np.asarray(direction, float) / length
