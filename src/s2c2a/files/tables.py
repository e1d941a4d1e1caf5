"""Tables of text from other people: encodings, delimiters, headers and numbers."""

import csv
import gzip
import io
import os
import re
import zlib
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, time
from itertools import chain, islice

from s2c2a.errors import S2C2AError
from s2c2a.files.text import open_regular

METERS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
DELIMITERS = (";", "\t", "|", ",", " ")
"""Delimiters, the likeliest first where two fit alike; " " stands for any blanks."""
BLANK = {"", "nan", "na", "n/a", "null", "none", "-nan", "nan(ind)", "-nan(ind)"}
SAMPLE = 20  # lines that show the delimiter; chosen: a few broken ones decide nothing
_COMMENT = re.compile(r"(#|//|%)")
_COMMENT_MARK = re.compile(r"(#|//)+\s*|%+\s+")
"""Mark of a comment that names columns; `%time` of `rostopic echo -p` is a name."""


@dataclass(frozen=True)
class TextRows:
    """Rows of a table of text.

    Attributes:
        names: names of the columns: those of the header, or 1, 2, ... without one;
            empty where the text has no rows.
        rows: number of the line, from 1, and cells of each row that is not blank.
        decimal_comma: whether numbers may have a decimal comma.
    """

    names: list[str]
    rows: Iterator[tuple[int, list[str]]]
    decimal_comma: bool


def read_any_text(path: str | os.PathLike, fault: type[S2C2AError], most: int) -> str:
    """Return the text of a file, which may be gzipped.

    It is UTF-8, UTF-16 with its byte order mark, or Windows-1252, in which programs of
    western languages write when the text is no valid UTF-8.

    Args:
        path: the file.
        fault: class of the exception.
        most: maximum size after unpacking [bytes].

    Raises:
        S2C2AError: the file cannot be read, is too large, or is no such text.
    """
    try:
        with open_regular(path) as file:
            is_gzip = file.read(2) == b"\x1f\x8b"
            file.seek(0)
            with gzip.open(file) if is_gzip else file as unpacked:
                content = unpacked.read(most + 1)
        if len(content) > most:
            raise fault(
                f"{path} has more than {most} bytes of text; save fewer rows or columns"
            )
        if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return content.decode("utf-16")
        try:
            return content.decode("utf-8-sig")
        except UnicodeError:
            if b"\0" in content:  # no text
                raise
            return content.decode("cp1252")
    except (OSError, EOFError, UnicodeError, zlib.error) as error:
        raise fault(
            f"{path} cannot be read as text: {error}; check the path, and save the "
            "file as UTF-8"
        ) from error


def parse_rows(
    text: str, skip_lines: int = 0, wanted: Collection[str] = ()
) -> TextRows:
    """Find delimiter and header of a table of text.

    The last comment before the rows is the header if it has as many cells, and the rows
    are without one, or it has the wanted names.

    Args:
        text: the table; lines that begin with #, // or % are comments.
        skip_lines: number of lines above the header.
        wanted: names that are looked for.

    Raises:
        csv.Error: a quoted cell does not end.
    """
    lines = io.StringIO(text, newline="")
    for _ in range(skip_lines):
        lines.readline()
    begin = lines.tell()
    comment, sample = _look_ahead(lines)
    lines.seek(begin)
    delimiter = find_delimiter(sample)
    rows = split_rows(lines, delimiter, skip_lines)
    first = next(rows, None)
    if first is None:
        return TextRows([], rows, delimiter != ",")
    names = [cell.strip() for cell in first[1]]
    is_headless = all(is_value(cell, delimiter != ",") for cell in names)
    noted = [name.strip() for name in next(_split([comment], delimiter), [])]
    is_wanted = not set(noted).isdisjoint(wanted) and set(names).isdisjoint(wanted)
    if len(noted) == len(names) and (is_headless or is_wanted):
        names = noted
    elif is_headless:
        names = [str(index + 1) for index in range(len(names))]
    else:
        return TextRows(names, rows, delimiter != ",")
    return TextRows(names, chain([first], rows), delimiter != ",")


def _look_ahead(lines: io.StringIO) -> tuple[str, list[str]]:
    """The last comment before the rows without its mark, and the first rows."""
    comment = ""
    for line in lines:
        if not _COMMENT.match(line):
            if not line.strip():
                continue
            rest = (each for each in lines if each.strip() and not is_comment(each))
            return comment, [line, *islice(rest, SAMPLE - 1)]
        comment = _COMMENT_MARK.sub("", line, count=1)
    return comment, []


def is_comment(line: str) -> bool:
    """Whether a line is a comment."""
    return _COMMENT.match(line) is not None


def find_delimiter(sample: Sequence[str]) -> str:
    """The delimiter that gives most numbers in rows as long as the first one, or longer."""
    scores = dict.fromkeys(DELIMITERS, -1.0) | {",": 0.0}
    for delimiter in DELIMITERS:
        rows = list(_split(sample, delimiter))
        width = len(rows[0]) if rows else 0
        if width < 2:
            continue
        whole = [cell for row in rows if len(row) >= width for cell in row]
        values = sum(is_value(cell, delimiter != ",") for cell in whole)
        scores[delimiter] = values / sum(map(len, rows))
    return max(DELIMITERS, key=scores.__getitem__)


def split_rows(
    lines: io.StringIO, delimiter: str, first_line: int = 0
) -> Iterator[tuple[int, list[str]]]:
    """Yield the number of the line and the cells of each row that is not blank.

    Raises:
        csv.Error: a quoted cell does not end.
    """
    # a comment becomes a blank line, which preserves the numbers of lines
    kept = ("\n" if is_comment(line) else line for line in lines)
    reader = _split(kept, delimiter)
    for row in reader:
        if any(cell.strip() for cell in row):
            yield first_line + reader.line_num, row


def _split(lines, delimiter: str):
    """Reader of lines with a delimiter."""
    if delimiter == " ":
        return csv.reader(
            (" ".join(line.split()) + "\n" for line in lines), delimiter=" "
        )
    return csv.reader(lines, delimiter=delimiter, skipinitialspace=True)


def is_value(cell: str, decimal_comma: bool) -> bool:
    """Whether a cell is blank, a number or a time stamp, and thus no name."""
    if cell.strip().lower() in BLANK:
        return True
    is_number = parse_number(cell, decimal_comma) is not None
    return is_number or parse_stamp(cell) is not None


def parse_number(cell: str, decimal_comma: bool) -> float | None:
    """Number in a cell, which may be infinite or NaN; None for text."""
    # `float` would accept 1_000
    if "_" in cell:
        return None
    if decimal_comma and cell.count(",") == 1 and "." not in cell:
        cell = cell.replace(",", ".")
    try:
        return float(cell)
    except ValueError:
        return None


def parse_stamp(cell: str) -> float | None:
    """Time of an ISO 8601 time stamp [s]; None for text.

    It counts from 1970, UTC without a zone, or, of a time of day such as 11:33:04.5,
    from midnight.
    """
    cell = cell.strip()
    try:
        if cell[2:3] == ":":
            hour = time.fromisoformat(cell).replace(tzinfo=None)
            since = datetime.combine(datetime.min, hour) - datetime.min
            return since.total_seconds()
        stamp = datetime.fromisoformat(cell)
    except ValueError:
        return None
    return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
