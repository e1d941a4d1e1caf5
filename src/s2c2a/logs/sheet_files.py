"""XLSX files as tables: the first sheet, with names in its first row."""

import os
from collections.abc import Iterator, Sequence
from itertools import chain, islice
from typing import Any

from s2c2a.logs.errors import (
    MAX_COLUMNS,
    MAX_ROWS,
    LogError,
    needs_extra,
    reading_as,
)
from s2c2a.logs.tables import ColumnRequest, Table, TableBuilder, unnamed_cells

Rows = Iterator[tuple[int, Sequence[Any]]]


def read_xlsx(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read the requested columns of the first sheet.

    Raises:
        LogError: the extra is missing, or the file is damaged, too large, or has none
            of the columns.
    """
    with needs_extra(path, "XLSX"):
        import openpyxl  # noqa: PLC0415  # an extra
    with reading_as(path, "XLSX", "export it as CSV"):
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        try:
            sheet = book.worksheets[0]
            # the stated size may be wrong
            sheet.reset_dimensions()
            return _read(
                path, _filled(path, sheet.iter_rows(values_only=True)), request
            )
        finally:
            book.close()


def _filled(path: str | os.PathLike, rows: Iterator[Sequence[Any]]) -> Rows:
    """Number and cells of each row; blank rows count, since a file may claim many."""
    for number, row in enumerate(rows, 1):
        if number > MAX_ROWS:
            raise LogError(f"{path} has more than {MAX_ROWS} rows; split the sheet")
        if len(row) > MAX_COLUMNS:
            raise LogError(
                f"{path} has {len(row)} columns; at most {MAX_COLUMNS} are read"
            )
        yield number, row


def _read(path: str | os.PathLike, rows: Rows, request: ColumnRequest) -> Table:
    filled: Rows = (
        (line, row)
        for line, row in islice(rows, request.skip_lines, None)
        if any(str(cell).strip() for cell in row if cell is not None)
    )
    first = next(filled, None)
    if first is None:
        raise LogError(f"{path} has an empty first sheet; put the log there")
    names = ["" if cell is None else str(cell).strip() for cell in first[1]]
    while not names[-1]:
        names.pop()
    if not any(isinstance(cell, str) for cell in first[1]):
        names = [str(index + 1) for index in range(len(names))]
        filled = chain([first], filled)
    builder = TableBuilder(path, request, names)
    places = [names.index(name) for name in (*builder.numbers, *builder.labels)]
    for line, row in filled:
        cells = [row[place] if place < len(row) else None for place in places]
        builder.add(f"row {line}", cells, unnamed_cells(row, names))
    return builder.build()
