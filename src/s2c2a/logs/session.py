"""A session: what a map finds in the tables of a log, in SI units, still in the frame of the file."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from jaxtyping import Float

from s2c2a.logs.errors import LogError
from s2c2a.logs.map import Drive, End, LogMap, Three
from s2c2a.logs.tables import Table, listed

METERS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}


@dataclass(frozen=True)
class Session:
    """What was logged, row by row.

    Attributes:
        time: [s], rising where it is a number, shape (rows,); numbers of rows over the
            rate where no column says it.
        commanded: what drives were told [m, N or free], positive as in the file, shape
            (rows, drives); NaN: unknown.
        measured: what they said of themselves, the same.
        positions: of the ends [m], frame of the file, shape (rows, ends, 3); NaN: not
            seen.
        axes: unit vectors along the arm there, the same.
        labels: text, shape (rows,); empty where none is asked for.
        broken: rows that could not be read.
    """

    time: Float[np.ndarray, " rows"]
    commanded: Float[np.ndarray, "rows drives"]
    measured: Float[np.ndarray, "rows drives"]
    positions: Float[np.ndarray, "rows ends 3"]
    axes: Float[np.ndarray, "rows ends 3"]
    labels: np.ndarray
    broken: int = 0

    def __len__(self) -> int:
        """How many rows."""
        return len(self.time)

    @property
    def driven(self) -> Float[np.ndarray, "rows drives"]:
        """What the drives did: measured, else what they were told."""
        return np.where(np.isfinite(self.measured), self.measured, self.commanded)


def session_of(tables: Sequence[Table], told: LogMap) -> Session:
    """Read one session's tables, joined where there are several.

    Raises:
        LogError: a column is missing, or nothing matches.
    """
    table = _part(_joined(tables, told.join.key) if told.join else tables[0], told)
    if missing := (told.numbers - set(table.numbers)) | (told.words - set(table.words)):
        raise LogError(
            f"{table.path} lacks columns that the map names: {listed(sorted(missing))}"
        )
    unit = told.rows.unit
    turn = SECONDS[unit] if isinstance(unit, str) else unit
    number = np.arange(len(table), dtype=float)
    time = (
        table.numbers[told.rows.time] * turn
        if told.rows.time
        else number / (told.rows.rate or told.arm.control_rate)
    )
    return Session(
        time,
        _of_drives(table, told, "commanded"),
        _of_drives(table, told, "measured"),
        np.stack(
            [_vectors(table, end.position) * METERS[end.unit] for end in told.ends],
            axis=1,
        ),
        np.stack([_axis(table, end) for end in told.ends], axis=1),
        table.words[told.rows.label] if told.rows.label else np.full(len(table), ""),
        table.broken,
    )


def _part(table: Table, told: LogMap) -> Table:
    begin = told.rows.first_row
    count = told.rows.rows
    chosen = table.rows(
        np.arange(len(table))[begin : None if count is None else begin + count]
    )
    if len(chosen) < 2:
        raise LogError(
            f"{table.path} holds {len(chosen)} rows from row {begin} on; at least two are needed"
        )
    return chosen


def _joined(tables: Sequence[Table], key: str) -> Table:
    """Rows whose key every table has, in the order of the first one."""
    for table in tables:
        if key not in table.numbers:
            raise LogError(
                f"{table.path} lacks the column '{key}' that joins the files"
            )
        keys = table.numbers[key]
        if len(np.unique(keys)) < len(keys) or np.isnan(keys).any():
            raise LogError(
                f"{table.path}: '{key}' is blank or says a number twice, so rows cannot be matched by it"
            )
    common = reduce(np.intersect1d, [table.numbers[key] for table in tables])
    if not len(common):
        raise LogError(
            f"{' and '.join(table.path for table in tables)} have no '{key}' in common"
        )
    names = [
        name
        for table in tables
        for name in (*table.numbers, *table.words)
        if name != key
    ]
    if twice := {name for name in names if names.count(name) > 1}:
        raise LogError(
            f"{listed(sorted(twice))}: in several of the joined files; each column needs a name of its own"
        )
    parts = [table.rows(_places(table.numbers[key], common)) for table in tables]
    numbers = {name: column for part in parts for name, column in part.numbers.items()}
    words = {name: column for part in parts for name, column in part.words.items()}
    return Table(
        " + ".join(table.path for table in tables),
        numbers,
        words,
        sum(table.broken for table in tables),
    )


def _places(keys: np.ndarray, desired: np.ndarray) -> np.ndarray:
    order = np.argsort(keys)
    return order[np.searchsorted(keys, desired, sorter=order)]


def _of_drives(table: Table, told: LogMap, which: str) -> np.ndarray:
    columns = [getattr(drive, which) for drive in told.drives]
    nothing = np.full(len(table), np.nan)
    values = [
        nothing
        if column is None
        else (table.numbers[column] - drive.offset) * factor_of(drive, told)
        for column, drive in zip(columns, told.drives, strict=True)
    ]
    return np.stack(values, axis=1)


def factor_of(drive: Drive, told: LogMap) -> float:
    """What turns a drive's column into meters or newtons; 1 for one in free units."""
    radius = told.arm.pulley_radius or 0.0
    turns = {
        "turns": 2 * np.pi,
        "ticks": 2 * np.pi / told.arm.ticks_per_turn,
        "deg": np.pi / 180,
        "rad": 1.0,
    }
    return {"N": 1.0, "free": 1.0, "m": 1.0, "mm": 1e-3}.get(drive.unit) or turns[
        drive.unit
    ] * radius


def _vectors(table: Table, columns: Sequence[str]) -> np.ndarray:
    return np.stack([table.numbers[column] for column in columns], axis=-1)


def _axis(table: Table, end: End) -> np.ndarray:
    """Unit vectors along the arm, NaN where nothing says them."""
    if end.axis is not None:
        return _unit(_vectors(table, end.axis))
    columns = end.quaternion or end.euler
    if columns is None:
        return np.full((len(table), 3), np.nan)
    values = _vectors(table, columns)
    along = direction(end.along)
    known = np.isfinite(values).all(axis=1) & (
        np.abs(values).sum(axis=1) > 0 if end.quaternion else True
    )
    axes = np.full((len(table), 3), np.nan)
    axes[known] = _turned(values[known], end, along)
    return axes


def _turned(values: np.ndarray, end: End, along: np.ndarray) -> np.ndarray:
    """The body's direction along the arm, under rotations."""
    from scipy.spatial.transform import Rotation

    if end.quaternion is not None:
        return Rotation.from_quat(
            values if end.order == "xyzw" else values[:, [1, 2, 3, 0]]
        ).apply(along)
    return Rotation.from_euler(
        end.sequence or "", values, degrees=end.euler_unit == "deg"
    ).apply(along)


def _unit(vectors: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(
        vectors, lengths, out=np.full(vectors.shape, np.nan), where=lengths > 0
    )


def direction(said: str | Three) -> Float[np.ndarray, "3"]:
    """A unit vector from `-y` or from three numbers.

    Raises:
        LogError: neither, or the vector has no length.
    """
    if isinstance(said, str):
        if said[-1:] not in "xyz" or said[:-1] not in ("", "+", "-") or not said:
            raise LogError(
                f"'{said}' is no direction; say x, -y, z, ..., or three numbers"
            )
        return (-1.0 if said.startswith("-") else 1.0) * np.eye(3)[
            "xyz".index(said[-1])
        ]
    length = float(np.linalg.norm(said))
    if not length > 0:
        raise LogError(f"{list(said)} has no length, so it is no direction")
    return np.asarray(said, float) / length
