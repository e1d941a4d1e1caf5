"""Log files as tables of named columns: CSV, NPZ, and MAT.

File sizes are checked before anything is loaded, and unreadable values are errors.
"""

import csv
import gzip
import io
import os
import zlib
from array import array
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

import numpy as np

from s2c2a.logs.array_files import read_mat, read_npz
from s2c2a.logs.errors import MAX_BYTES, MAX_COLUMNS, MAX_ROWS, LogError

BLANK = {"", "nan", "na", "n/a", "null", "none", "-nan", "nan(ind)", "-nan(ind)"}
MAX_CELL_LENGTH = 400
MAX_SHOWN = 12


@dataclass(frozen=True)
class Table:
    """Named columns of one file, all of the same length.

    Attributes:
        path: path of the file, for error messages.
        numbers: numeric columns by name; blank cells and infinite values are NaN.
        labels: text columns by name.
        broken_rows: number of unreadable rows, which are NaN.
    """

    path: str
    numbers: Mapping[str, np.ndarray]
    labels: Mapping[str, np.ndarray]
    broken_rows: int = 0

    def __len__(self) -> int:
        """Number of rows."""
        columns = (*self.numbers.values(), *self.labels.values())
        return len(columns[0]) if columns else 0

    def select(self, rows: np.ndarray) -> "Table":
        """Table of the rows with these indices."""
        numbers = {name: column[rows] for name, column in self.numbers.items()}
        labels = {name: column[rows] for name, column in self.labels.items()}
        return Table(self.path, numbers, labels, self.broken_rows)


@dataclass(frozen=True)
class ColumnRequest:
    """Columns to read from a file.

    Attributes:
        numbers: names of numeric columns.
        labels: names of text columns.
        skip_lines: number of lines above the header.
        allow_broken_rows: whether an unreadable row becomes NaN; otherwise it is an
            error.
    """

    numbers: Collection[str]
    labels: Collection[str] = ()
    skip_lines: int = 0
    allow_broken_rows: bool = False


def read_table(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read those requested columns that a file has.

    Args:
        path: file ending in .npz or .mat, or delimited text, which may be gzipped.
        request: columns to read.

    Raises:
        LogError: the file cannot be read or is too large, or a row is cut off or holds
            text in a numeric column.
    """
    if Path(path).suffix.lower() in (".npz", ".mat"):
        return _read_arrays(path, request)
    if not Path(path).is_file():
        raise LogError(f"{path} does not exist; check the path of the log")
    try:
        return _read_text(path, request)
    except (
        OSError,
        EOFError,
        UnicodeError,
        zlib.error,
        csv.Error,
        ValueError,
    ) as error:
        raise LogError(
            f"{path} cannot be read as delimited text: {error}; "
            "check that it is a complete CSV file"
        ) from error


def list_names(names: Collection[str]) -> str:
    """Comma-separated names, shortened to the first dozen."""
    if not names:
        return "none"
    shown = ", ".join(name[:40] for name in islice(names, MAX_SHOWN))
    return shown + (", ..." if len(names) > MAX_SHOWN else "")


def _read_arrays(path: str | os.PathLike, request: ColumnRequest) -> Table:
    read = read_npz if Path(path).suffix.lower() == ".npz" else read_mat
    arrays = read(path)
    numbers = {}
    labels = {}
    lengths = {}
    for name, column in arrays.items():
        if name in request.labels:
            labels[name] = column.astype(str)
            lengths[name] = len(column)
        if name in request.numbers:
            numbers[name] = _as_numbers(path, name, column)
            lengths[name] = len(column)
    if len(set(lengths.values())) > 1:
        raise LogError(
            f"{path} has columns of different lengths: {lengths}; "
            "save arrays with the same number of rows"
        )
    _check_any_found(path, lengths, arrays)
    return Table(str(path), numbers, labels)


def _as_numbers(path: str | os.PathLike, name: str, column: np.ndarray) -> np.ndarray:
    try:
        values = column.astype(float)
    except ValueError as error:
        raise LogError(
            f"{path}: column '{name}' holds text where numbers are expected: {error}; "
            "correct the column"
        ) from error
    return np.where(np.isfinite(values), values, np.nan)


def _check_any_found(
    path: str | os.PathLike, found: Collection[str], available: Collection[str]
) -> None:
    if not found:
        raise LogError(
            f"{path} has none of the columns that the map names; "
            f"it has {list_names(available)}"
        )


def _read_text(path: str | os.PathLike, request: ColumnRequest) -> Table:
    lines = io.StringIO(_decode(path), newline="")
    for _ in range(request.skip_lines):
        lines.readline()
    return _TextParser(path, lines, request).read()


def _decode(path: str | os.PathLike) -> str:
    """Text of a file, unpacked to at most the size limit."""
    with open(path, "rb") as file:
        is_gzip = file.read(2) == b"\x1f\x8b"
    with gzip.open(path, "rb") if is_gzip else open(path, "rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise LogError(
            f"{path} has more than {MAX_BYTES} bytes of text; "
            "save fewer rows or columns"
        )
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16")
    return content.decode("utf-8-sig")


def _detect_delimiter(lines: io.StringIO) -> str:
    """Delimiter of the first line that is neither blank nor a comment."""
    begin = lines.tell()
    delimiter = ","
    for line in lines:
        if line.strip() and not line.startswith("#"):
            if ";" in line:
                delimiter = ";"
            elif "\t" in line:
                delimiter = "\t"
            break
    lines.seek(begin)
    return delimiter


def _blank_comments(lines: io.StringIO) -> Iterator[str]:
    """Lines with comments replaced by blank lines, which preserves line numbers."""
    for line in lines:
        yield "\n" if line.startswith("#") else line


class _TextParser:
    """Parser of delimited text into columns."""

    def __init__(
        self, path: str | os.PathLike, lines: io.StringIO, request: ColumnRequest
    ):
        delimiter = _detect_delimiter(lines)
        self._path = path
        self._request = request
        self._reader = csv.reader(
            _blank_comments(lines), delimiter=delimiter, skipinitialspace=True
        )
        self._decimal_comma = delimiter != ","
        self._broken_rows = 0

    def read(self) -> Table:
        """Parse all rows."""
        names, first_rows = self._read_header()
        numbers = _find_columns(names, self._request.numbers)
        labels = _find_columns(names, self._request.labels)
        _check_any_found(self._path, {*numbers, *labels}, names)
        positions = list(numbers.values())
        values = array("d")
        label_rows: list[list[str]] = []
        for row in chain(first_rows, self._reader):
            if _is_blank(row):
                continue
            values.extend(self._parse_row(row, names, positions))
            label_rows.append(_cells(row, labels.values()))
            if len(label_rows) > MAX_ROWS:
                raise LogError(
                    f"{self._path} has more than {MAX_ROWS} rows; split the file"
                )
        columns = np.array(values).reshape(len(label_rows), len(positions)).T
        label_columns = {
            name: np.array([row[index] for row in label_rows], object)
            for index, name in enumerate(labels)
        }
        return Table(
            str(self._path),
            dict(zip(numbers, columns, strict=True)),
            label_columns,
            self._broken_rows,
        )

    def _read_header(self) -> tuple[list[str], list[list[str]]]:
        """Column names, and the first row if the file has no header.

        The columns of a file without a header are named `1`, `2`, and so on.
        """
        first = next((row for row in self._reader if not _is_blank(row)), None)
        if first is None:
            raise LogError(f"{self._path} is empty")
        if len(first) > MAX_COLUMNS:
            raise LogError(
                f"{self._path} has {len(first)} columns; at most {MAX_COLUMNS} are read"
            )
        names = [cell.strip() for cell in first]
        if all(self._parse_number(name) is not None for name in names):
            numbers = [str(index + 1) for index in range(len(names))]
            return numbers, [first]
        requested = {*self._request.numbers, *self._request.labels}
        duplicates = {name for name in requested if name and names.count(name) > 1}
        if duplicates:
            raise LogError(
                f"{self._path} has several columns called "
                f"{list_names(sorted(duplicates))}; give each its own name"
            )
        return names, []

    def _parse_row(
        self, row: list[str], names: list[str], positions: list[int]
    ) -> list[float]:
        """Numbers at some positions of the row that was read last."""
        values = [
            self._parse_number(row[position]) if position < len(row) else None
            for position in positions
        ]
        error = _find_error(row, values, names, positions)
        if not error:
            return [value for value in values if value is not None]
        if not self._request.allow_broken_rows:
            raise LogError(
                f"{self._path}: line {self._reader.line_num}, {error}; correct the row, or set "
                'broken_rows = "gap" in the map to treat such rows as gaps'
            )
        self._broken_rows += 1
        return [np.nan] * len(values)

    def _parse_number(self, cell: str) -> float | None:
        """Number in a cell; NaN for a blank one, None for text."""
        cell = cell.strip()
        if cell.lower() in BLANK:
            return np.nan
        # `float` would accept 1_000
        if len(cell) > MAX_CELL_LENGTH or "_" in cell:
            return None
        if self._decimal_comma and cell.count(",") == 1 and "." not in cell:
            cell = cell.replace(",", ".")
        try:
            value = float(cell)
        except ValueError:
            return None
        return value if np.isfinite(value) else np.nan


def _find_columns(names: list[str], requested: Collection[str]) -> dict[str, int]:
    """Positions of those requested columns that exist."""
    return {name: index for index, name in enumerate(names) if name in requested}


def _is_blank(row: list[str]) -> bool:
    return not any(cell.strip() for cell in row)


def _cells(row: list[str], positions: Collection[int]) -> list[str]:
    """Text at some positions; empty where the row is cut off."""
    return [row[place].strip() if place < len(row) else "" for place in positions]


def _find_error(
    row: list[str],
    values: Sequence[float | None],
    names: list[str],
    positions: list[int],
) -> str:
    """First error of a row, empty if there is none."""
    for position, value in zip(positions, values, strict=True):
        if value is not None:
            continue
        if position < len(row):
            cell = row[position][:40]
            return f"column '{names[position]}': '{cell}' is not a number"
        return f"column '{names[position]}': the row is cut off"
    if len(row) < len(names):
        return f"column '{names[len(row)]}': the row is cut off"
    return ""
