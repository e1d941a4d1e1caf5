"""Tables of named columns, which the readers of all forms of logs fill."""

import json
import os
import re
from array import array
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from typing import Any

import numpy as np

from s2c2a.files.tables import BLANK, parse_number, parse_stamp
from s2c2a.logs.errors import MAX_ROWS, LogError

MAX_CELL_LENGTH = 400
MAX_SHOWN = 12
PREFIXED = re.compile(r"\d+:.")


@dataclass(frozen=True)
class Table:
    """Named columns of one file, all of the same length.

    Attributes:
        path: path of the file, for error messages.
        numbers: numeric columns by name; blank cells and infinite values are NaN.
        labels: text columns by name.
        broken_rows: number of unreadable rows, which are NaN.
        stamps: columns of time stamps, which are seconds since 1970 in `numbers`.
        length_unit: unit of lengths that the file states, such as "mm"; empty if none.
        available: names of all columns of the file, for error messages.
    """

    path: str
    numbers: Mapping[str, np.ndarray]
    labels: Mapping[str, np.ndarray]
    broken_rows: int = 0
    stamps: frozenset[str] = frozenset()
    length_unit: str = ""
    available: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Number of rows."""
        columns = (*self.numbers.values(), *self.labels.values())
        return len(columns[0]) if columns else 0

    def select(self, rows: np.ndarray) -> "Table":
        """Table of the rows with these indices."""
        numbers = {name: column[rows] for name, column in self.numbers.items()}
        labels = {name: column[rows] for name, column in self.labels.items()}
        return replace(self, numbers=numbers, labels=labels)

    def in_map(self, names: Mapping[str, str]) -> "Table":
        """The table with the names of the map.

        Args:
            names: in the map -> in the file, where they differ.
        """
        theirs = {name: named for named, name in names.items()}
        return replace(
            self,
            numbers={
                theirs.get(name, name): self.numbers[name] for name in self.numbers
            },
            labels={theirs.get(name, name): self.labels[name] for name in self.labels},
            stamps=frozenset(theirs.get(name, name) for name in self.stamps),
        )


@dataclass(frozen=True)
class ColumnRequest:
    """Columns to read from a file.

    Attributes:
        numbers: names of numeric columns.
        labels: names of text columns.
        skip_lines: number of lines above the header.
        allow_broken_rows: whether an unreadable row becomes NaN; otherwise it is an
            error.
        times: names of the numeric columns that may hold time stamps.
        topic: topic of a bag.
    """

    numbers: Collection[str]
    labels: Collection[str] = ()
    skip_lines: int = 0
    allow_broken_rows: bool = False
    times: Collection[str] = ()
    topic: str | None = None

    @property
    def names(self) -> set[str]:
        """Names of all columns."""
        return {*self.numbers, *self.labels}

    def in_file(self, names: Mapping[str, str]) -> "ColumnRequest":
        """The request with the names of columns in one file.

        Args:
            names: in the map -> in the file, where they differ.
        """
        return replace(
            self,
            numbers={names.get(name, name) for name in self.numbers},
            labels={names.get(name, name) for name in self.labels},
            times={names.get(name, name) for name in self.times},
        )


def list_names(names: Collection[str]) -> str:
    """Comma-separated names, shortened to the first dozen."""
    named = [name[:40] for name in names if name.strip()]
    if not named:
        return "none"
    return ", ".join(named[:MAX_SHOWN]) + (", ..." if len(named) > MAX_SHOWN else "")


def prefix_advice(names: Iterable[str]) -> str:
    """How maps name columns of joined files, where a name begins like those; or empty."""
    if not any(PREFIXED.match(name) for name in names):
        return ""
    return (
        "; N:NAME is column NAME of the Nth file that the map joins, and a column "
        "called 1:x itself is 1:1:x"
    )


def check_distinct(tables: Iterable["Table"], shared: str) -> None:
    """Refuse files of a take that have a column in common but the shared one.

    Raises:
        LogError: a column occurs twice.
    """
    seen: set[str] = set()
    duplicates: set[str] = set()
    for table in tables:
        columns = {*table.numbers, *table.labels} - {shared}
        duplicates |= columns & seen
        seen |= columns
    if duplicates:
        raise LogError(
            f"several of the joined files have {list_names(sorted(duplicates))}; "
            "write 1:NAME, 2:NAME, ... in the map for that of the first file, the second, ..."
        )


def check_any_found(
    path: str | os.PathLike,
    found: Collection[str],
    available: Collection[str],
    skipped_lines: int = 0,
) -> None:
    """Refuse a file without any of the columns.

    Raises:
        LogError: nothing is found.
    """
    if not found:
        below = "; if names stand further down, set rows.skip_lines to the lines above"
        if skipped_lines:
            below = (
                f", below the {skipped_lines} lines that rows.skip_lines skips; correct "
                "that number if these are not the names, or not the first row"
            )
        raise LogError(
            f"{path} has none of the columns that the map names; "
            f"it has {list_names(available)}{below}{prefix_advice(available)}"
        )


def unnamed_cells(row: Sequence[Any], names: Sequence[str]) -> str:
    """The fault of a row with more cells than names; columns may have shifted."""
    beyond = row[len(names) :]
    if all(cell is None or not str(cell).strip() for cell in beyond):
        return ""
    return f"it has {len(row)} cells, and the header {len(names)} names"


class TableBuilder:
    """Builder of a table from rows of cells: text, numbers, times, or nothing.

    Attributes:
        numbers: names of the numeric columns, in the order of the cells.
        labels: names of the text columns, whose cells follow.
    """

    def __init__(
        self,
        path: str | os.PathLike,
        request: ColumnRequest,
        available: Collection[str],
        decimal_comma: bool = False,
    ):
        self.numbers = [name for name in request.numbers if name in available]
        self.labels = [name for name in request.labels if name in available]
        found = [*self.numbers, *self.labels]
        check_any_found(path, found, available, request.skip_lines)
        self._path = path
        self._available = tuple(available)
        self._request = request
        self._decimal_comma = decimal_comma
        self._values = array("d")
        self._label_rows: list[list[str]] = []
        self._stamp_counts = dict.fromkeys(request.times, 0)
        self._broken_rows = 0

    def add(self, place: str, cells: Sequence[Any], fault: str = "") -> None:
        """Add a row.

        Args:
            place: where it is in the file, such as "line 3".
            cells: of the numeric columns, then of the text columns.
            fault: why the row as a whole is unreadable; empty if it is not.

        Raises:
            LogError: the row is unreadable and must not be, or there are too many.
        """
        values = []
        for name, cell in zip(self.numbers, cells, strict=False):
            value = self._number(name, cell)
            if value is None:
                form = "no time" if name in self._stamp_counts else "not a number"
                fault = fault or f"column '{name}': '{cell!s:.40}' is {form}"
                break
            values.append(value)
        if fault:
            if not self._request.allow_broken_rows:
                advice = "correct the row"
                if fault.endswith("no time"):
                    advice = (
                        "write numbers, times of day (11:33:04.5), or ISO 8601 "
                        "(2026-01-31 11:33:04.5)"
                    )
                raise LogError(
                    f"{self._path}: {place}, {fault}; {advice}, or set "
                    'broken_rows = "gap" in the map to treat such rows as gaps'
                )
            self._broken_rows += 1
            values = [np.nan] * len(self.numbers)
        self._values.extend(values)
        texts = [
            "" if cell is None else str(cell) for cell in cells[len(self.numbers) :]
        ]
        self._label_rows.append(texts)
        if len(self._label_rows) > MAX_ROWS:
            raise LogError(f"{self._path} has more than {MAX_ROWS} rows; split it")

    def build(self, length_unit: str = "") -> Table:
        """The table of all rows.

        Raises:
            LogError: a column mixes numbers and time stamps.
        """
        rows = len(self._label_rows)
        columns = np.array(self._values).reshape(rows, len(self.numbers)).T
        numbers = dict(zip(self.numbers, columns, strict=True))
        labels = {
            name: np.array([row[index] for row in self._label_rows], object)
            for index, name in enumerate(self.labels)
        }
        stamps = set()
        for name, count in self._stamp_counts.items():
            if not count:
                continue
            stamps.add(name)
            if count < np.isfinite(numbers[name]).sum():
                raise LogError(
                    f"{self._path}: column '{name}' has both numbers and time stamps; "
                    "write all times in one form"
                )
        return Table(
            str(self._path),
            numbers=numbers,
            labels=labels,
            broken_rows=self._broken_rows,
            stamps=frozenset(stamps),
            length_unit=length_unit,
            available=self._available,
        )

    def _number(self, name: str, cell: Any) -> float | None:
        """Number in a cell; NaN for a blank one, None for text."""
        value = self._parse(name, cell)
        return value if value is None or np.isfinite(value) else np.nan

    def _parse(self, name: str, cell: Any) -> float | None:
        if cell is None:
            return np.nan
        if isinstance(cell, int | float):
            return number_or_nan(cell)
        value = None
        if isinstance(cell, str):
            if cell.strip().lower() in BLANK:
                return np.nan
            if len(cell) > MAX_CELL_LENGTH:
                return None
            value = parse_number(cell, self._decimal_comma)
        if value is None and name in self._stamp_counts:
            value = seconds_of(cell)
            self._stamp_counts[name] += value is not None
        return value


def number_or_nan(value: float) -> float:
    """A number in double precision; NaN beyond its range."""
    try:
        return float(value)
    except OverflowError:
        return np.nan


def seconds_of(cell: Any) -> float | None:
    """Time since 1970 of a time stamp or a date [s]; None for anything else."""
    if isinstance(cell, str):
        return parse_stamp(cell)
    if isinstance(cell, datetime):
        return (cell if cell.tzinfo else cell.replace(tzinfo=UTC)).timestamp()
    if isinstance(cell, date):
        return datetime(cell.year, cell.month, cell.day, tzinfo=UTC).timestamp()
    return None


def table_of_arrays(
    path: str | os.PathLike, arrays: Mapping[str, np.ndarray], request: ColumnRequest
) -> Table:
    """Table of the requested columns among arrays.

    Raises:
        LogError: none is found, their lengths differ, or one holds text where numbers
            are expected.
    """
    numbers = {}
    labels = {}
    stamps = set()
    for name, column in arrays.items():
        if name in request.labels:
            labels[name] = column.astype(str)
        if name in request.numbers:
            numbers[name] = _as_numbers(path, name, column)
            if column.dtype.kind == "M":
                stamps.add(name)
    lengths = {name: len(column) for name, column in (numbers | labels).items()}
    if len(set(lengths.values())) > 1:
        raise LogError(
            f"{path} has columns of different lengths: {lengths}; "
            "save arrays with the same number of rows"
        )
    check_any_found(path, lengths, arrays)
    return Table(
        str(path),
        numbers=numbers,
        labels=labels,
        stamps=frozenset(stamps),
        available=tuple(arrays),
    )


def _as_numbers(path: str | os.PathLike, name: str, column: np.ndarray) -> np.ndarray:
    if column.dtype.kind == "M":
        since = column - np.datetime64(0, "s")
        return since / np.timedelta64(1, "s")
    try:
        values = column.astype(float)
    except (TypeError, ValueError) as error:
        raise LogError(
            f"{path}: column '{name}' holds text where numbers are expected: {error}; "
            "correct the column"
        ) from error
    return np.where(np.isfinite(values), values, np.nan)


def pack_table(table: Table) -> list[np.ndarray]:
    """A table as arrays without objects, for another process.

    Each text of a column is one number, and the last array says the rest in JSON.
    """
    words = {}
    places = []
    for name, texts in table.labels.items():
        found, place = np.unique(texts, return_inverse=True)
        words[name] = found.tolist()
        places.append(place)
    facts = {
        "path": table.path,
        "numbers": list(table.numbers),
        "words": words,
        "broken_rows": table.broken_rows,
        "stamps": list(table.stamps),
        "length_unit": table.length_unit,
        "available": table.available,
    }
    packed = np.frombuffer(json.dumps(facts).encode(), np.uint8)
    return [*table.numbers.values(), *places, packed]


def unpack_table(arrays: Sequence[np.ndarray]) -> Table:
    """The table of `pack_table`."""
    *columns, packed = arrays
    facts = json.loads(packed.tobytes())
    count = len(facts["numbers"])
    places = dict(zip(facts["words"], columns[count:], strict=True))
    return Table(
        facts["path"],
        numbers=dict(zip(facts["numbers"], columns, strict=False)),
        labels={
            name: np.array(words, object)[places[name]]
            for name, words in facts["words"].items()
        },
        broken_rows=facts["broken_rows"],
        stamps=frozenset(facts["stamps"]),
        length_unit=facts["length_unit"],
        available=tuple(facts["available"]),
    )
