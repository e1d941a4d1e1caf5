"""Delimited text as tables, with the headers of motion capture systems."""

import csv
import os

from s2c2a.files.tables import parse_rows, read_any_text
from s2c2a.logs import motive, qualisys
from s2c2a.logs.capture_export import CaptureExport
from s2c2a.logs.errors import MAX_BYTES, MAX_COLUMNS, LogError
from s2c2a.logs.tables import (
    ColumnRequest,
    Table,
    TableBuilder,
    list_names,
    unnamed_cells,
)


def read_text_file(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read a file of delimited text.

    Raises:
        LogError: the file cannot be read or is too large, or a row is cut off or holds
            text in a numeric column.
    """
    text = read_any_text(path, LogError, MAX_BYTES)
    try:
        return _read(path, text, request)
    except (csv.Error, ValueError) as error:
        raise LogError(
            f"{path} cannot be read as delimited text: {error}; "
            "check that it is a complete CSV file"
        ) from error


def _read(path: str | os.PathLike, text: str, request: ColumnRequest) -> Table:
    found = _rows_of(path, text, request)
    names = found.names
    if len(names) > MAX_COLUMNS:
        raise LogError(
            f"{path} has {len(names)} columns; at most {MAX_COLUMNS} are read"
        )
    duplicates = {name for name in request.names if name and names.count(name) > 1}
    if duplicates:
        raise LogError(
            f"{path} has several columns called "
            f"{list_names(sorted(duplicates))}; give each its own name"
        )
    builder = TableBuilder(path, request, found.names, found.decimal_comma)
    wanted = (*builder.numbers, *builder.labels)
    places = [found.names.index(name) for name in wanted]
    width = len(found.names)
    for line, row in found.rows:
        fault = unnamed_cells(row, found.names)
        if len(row) < width:
            fault = f"column '{found.names[len(row)]}': the row is cut off"
            row = [*row, *[""] * (width - len(row))]
        cells = [row[place].strip() for place in places]
        builder.add(f"line {line}", cells, fault)
    return builder.build(found.length_unit)


def _rows_of(
    path: str | os.PathLike, text: str, request: ColumnRequest
) -> CaptureExport:
    """Names and rows of a text: an export, or a table without units."""
    for system in (motive, qualisys):
        if system.recognizes(text):
            return system.read_export(path, text)
    table = parse_rows(text, request.skip_lines, request.names)
    if not table.names:
        raise LogError(f"{path} is empty; give a log with rows")
    return CaptureExport(table.names, table.rows, "", table.decimal_comma)
