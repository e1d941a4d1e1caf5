"""Files of strangers as named columns: CSV, NPZ, MAT. Sizes are capped before anything is read, nothing is guessed."""

import csv
import gzip
import io
import os
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from s2c2a.logs.arrays import read_mat, read_npz
from s2c2a.logs.errors import MAX_BYTES, MAX_COLUMNS, MAX_ROWS, LogError

BLANK = {"", "nan", "na", "n/a", "null", "none", "-nan", "nan(ind)", "-nan(ind)"}
CHUNK = 5000
LONGEST_CELL = 400
MAX_SHOWN = 12


@dataclass(frozen=True)
class Table:
    """Named columns of one file, all of as many rows.

    Attributes:
        path: of the file, for errors.
        numbers: name -> values, NaN where nothing was written.
        words: name -> text, for columns that hold labels.
        broken: how many rows could not be read and are gaps.
    """

    path: str
    numbers: Mapping[str, np.ndarray]
    words: Mapping[str, np.ndarray]
    broken: int = 0

    def __len__(self) -> int:
        """How many rows."""
        return len(next(iter((*self.numbers.values(), *self.words.values())), ()))

    def rows(self, chosen: np.ndarray) -> "Table":
        """Some of the rows."""
        numbers = {name: column[chosen] for name, column in self.numbers.items()}
        words = {name: column[chosen] for name, column in self.words.items()}
        return Table(self.path, numbers, words, self.broken)


@dataclass(frozen=True)
class Asked:
    """What is desired of a file.

    Attributes:
        numbers: columns that hold numbers.
        words: columns that hold labels.
        skip: lines above the header.
        gaps: whether a row that cannot be read is a gap; an error if not.
    """

    numbers: Collection[str]
    words: Collection[str] = ()
    skip: int = 0
    gaps: bool = False


def read_table(path: str | os.PathLike, asked: Asked) -> Table:
    """The columns of a file that are asked for, as far as it has them.

    Args:
        path: ending in .npz or .mat, else text with a separator; any of the last may be
            compressed (.gz).
        asked: which columns.

    Raises:
        LogError: it cannot be read, is too large, or a row is cut off or holds text
            where a number is needed.
    """
    if Path(path).suffix.lower() in (".npz", ".mat"):
        return _of_arrays(path, asked)
    if not Path(path).is_file():
        raise LogError(f"no log at {path}")
    try:
        return _of_text(path, asked)
    except (
        OSError,
        EOFError,
        UnicodeError,
        zlib.error,
        csv.Error,
        ValueError,
    ) as error:
        raise LogError(
            f"{path}: cannot be read as text with a separator: {error}; is it cut off, or no CSV?"
        ) from error


def _of_arrays(path: str | os.PathLike, asked: Asked) -> Table:
    arrays = (read_npz if Path(path).suffix.lower() == ".npz" else read_mat)(path)
    there = {
        name: column
        for name, column in arrays.items()
        if name in {*asked.numbers, *asked.words}
    }
    if len({len(column) for column in there.values()}) > 1:
        raise LogError(
            f"{path}: columns of different lengths: { {name: len(column) for name, column in there.items()} }"
        )
    words = {
        name: column.astype(str)
        for name, column in there.items()
        if name in asked.words
    }
    numbers = {
        name: column.astype(float)
        for name, column in there.items()
        if name in asked.numbers
    }
    _check_found(path, {*numbers, *words}, arrays)
    return Table(str(path), numbers, words)


def _check_found(
    path: str | os.PathLike, found: Collection[str], there: Collection[str]
) -> None:
    if not found:
        raise LogError(
            f"{path} has none of the columns that the map names; it has {listed(there)}"
        )


def listed(names: Collection[str]) -> str:
    """The first of many names."""
    shown = ", ".join(name[:40] for name in islice(names, MAX_SHOWN))
    return shown + (", ..." if len(names) > MAX_SHOWN else "") or "none"


def _of_text(path: str | os.PathLike, asked: Asked) -> Table:
    lines = io.StringIO(_text(path), newline="")
    for _ in range(asked.skip):
        lines.readline()
    separator = _separator(lines)
    rows = _Rows(
        path,
        csv.reader(_without_remarks(lines), delimiter=separator, skipinitialspace=True),
        separator,
        asked,
    )
    names, first = rows.header()
    return rows.read(names, first)


def _text(path: str | os.PathLike) -> str:
    """All of it; of one that swells no more is read than is allowed."""
    with open(path, "rb") as file:
        packed = file.read(2) == b"\x1f\x8b"
    with gzip.open(path, "rb") if packed else open(path, "rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise LogError(
            f"{path} has more than {MAX_BYTES} bytes of text; take a part of it, or fewer columns"
        )
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16")
    return content.decode("utf-8-sig")


def _separator(lines: io.StringIO) -> str:
    """The likeliest one in the first line that says something."""
    begin = lines.tell()
    first = next(
        (line for line in lines if line.strip() and not line.startswith("#")), ""
    )
    lines.seek(begin)
    return next((sign for sign in ";\t" if sign in first), ",")


def _without_remarks(lines: io.StringIO) -> Iterator[str]:
    """Remarks become blank lines, so that lines keep their numbers."""
    for line in lines:
        yield "\n" if line.startswith("#") else line


class _Rows:
    """Rows of text on their way to columns."""

    def __init__(self, path: str | os.PathLike, reader, separator: str, asked: Asked):
        self._path = path
        self._reader = reader
        self._asked = asked
        self._broken = 0
        # where commas do not part cells, they are decimal commas
        self._comma = separator != ","

    def header(self) -> tuple[list[str], list[list[str]]]:
        """Names of columns; a file of bare numbers has `1`, `2`, ..., and its first row is one."""
        first = next(
            (row for row in self._reader if any(cell.strip() for cell in row)), None
        )
        if first is None:
            raise LogError(f"{self._path} holds nothing")
        if len(first) > MAX_COLUMNS:
            raise LogError(
                f"{self._path} has {len(first)} columns, at most {MAX_COLUMNS} are read"
            )
        names = [cell.strip() for cell in first]
        if all(self._number(name) is not None for name in names):
            return [str(number + 1) for number in range(len(names))], [first]
        twice = {name for name in names if name and names.count(name) > 1} & {
            *self._asked.numbers,
            *self._asked.words,
        }
        if twice:
            raise LogError(
                f"{self._path}: several columns are called {listed(sorted(twice))}; give each its own name"
            )
        return names, []

    def read(self, names: list[str], first: list[list[str]]) -> Table:
        """All rows."""
        numbers = {
            name: place
            for place, name in enumerate(names)
            if name in self._asked.numbers
        }
        words = {
            name: place for place, name in enumerate(names) if name in self._asked.words
        }
        _check_found(self._path, {*numbers, *words}, names)
        desired = {place: self._number for place in numbers.values()}
        read = [
            np.array([self._row(row, names, desired) for row in first], float).reshape(
                -1, len(desired)
            )
        ]
        said: list[list[str]] = [
            [row[place] for place in words.values()] for row in first
        ]
        while chunk := [
            (self._reader.line_num, row) for row in islice(self._reader, CHUNK)
        ]:
            whole = [
                (line, row) for line, row in chunk if row and any(map(str.strip, row))
            ]
            values = [self._row(row, names, desired, line) for line, row in whole]
            read.append(np.array(values, float).reshape(-1, len(desired)))
            said += [
                [
                    row[place].strip() if place < len(row) else ""
                    for place in words.values()
                ]
                for _, row in whole
            ]
            if sum(map(len, read)) > MAX_ROWS:
                raise LogError(
                    f"{self._path} has more than {MAX_ROWS} rows; take a part of it"
                )
        columns = np.concatenate(read).T
        labels = {
            name: np.array([row[number] for row in said], object)
            for number, name in enumerate(words)
        }
        return Table(
            str(self._path),
            dict(zip(numbers, columns, strict=True)),
            labels,
            self._broken,
        )

    def _row(
        self,
        row: list[str],
        names: list[str],
        desired: Mapping[int, Callable],
        line: int = 1,
    ) -> list[float]:
        values = []
        fault = ""
        for place, number in desired.items():
            value = number(row[place]) if place < len(row) else None
            if value is None:
                got = (
                    f"'{row[place][:40]}', no number"
                    if place < len(row)
                    else "nothing: the row is cut off"
                )
                fault = fault or f"line {line}, column '{names[place]}': {got}"
            values.append(np.nan if value is None else value)
        if len(row) < len(names) and not fault:
            fault = (
                f"line {line}, column '{names[len(row)]}': nothing: the row is cut off"
            )
        if fault and not self._asked.gaps:
            raise LogError(
                f'{self._path}: {fault}; mend it, or take such rows as gaps (broken_rows = "gap" in the map)'
            )
        self._broken += bool(fault)
        return [np.nan] * len(values) if fault else values

    def _number(self, cell: str) -> float | None:
        """What a cell says; NaN for a blank one, None for text."""
        cell = cell.strip()
        if cell.lower() in BLANK:
            return np.nan
        if len(cell) > LONGEST_CELL or "_" in cell:  # Python would read 1_000
            return None
        if self._comma and cell.count(",") == 1 and "." not in cell:
            cell = cell.replace(",", ".")
        try:
            value = float(cell)
        except ValueError:
            return None
        return value if np.isfinite(value) else np.nan
