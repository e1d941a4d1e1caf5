"""Tables in Markdown from the rows in `results/`: cells, lines and columns."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from tools import ROOT
from tools.markdown import table

RESULTS = ROOT / "results"
MISSING = "-"


@cache
def load_rows(path: str) -> tuple[dict[str, Any], ...]:
    """Rows of a file of results."""
    return tuple(json.loads((RESULTS / path).read_text(encoding="utf-8")))


def find_rows(path: str, **match: object) -> list[dict[str, Any]]:
    """Rows whose fields have these values."""
    return [
        row
        for row in load_rows(path)
        if all(row[name] == value for name, value in match.items())
    ]


def find_row(path: str, **match: object) -> dict[str, Any]:
    """The one row whose fields have these values.

    Raises:
        LookupError: no row has them, or several rows.
    """
    found = find_rows(path, **match)
    if len(found) != 1:
        raise LookupError(f"results/{path}: {len(found)} rows with {match}")
    return found[0]


def number(value: float | None, digits: int = 2) -> str:
    """A number of a table."""
    return MISSING if value is None else f"{value:.{digits}f}"


def three_digits(value: float | None) -> str:
    """A number of a table with values of different size."""
    return MISSING if value is None else f"{value:#.3g}".rstrip(".")


def with_spread(row: dict[str, Any]) -> str:
    """Mean of a row with its standard deviation between seeds."""
    if row["std_seeds"] is None:
        return number(row["mean"])
    return f"{number(row['mean'])} ± {number(row['std_seeds'])}"


@dataclass(frozen=True)
class Line:
    """A line of a table: label, and fields of its rows.

    Attributes:
        label: first cell.
        metrics: one value a metric, in one cell.
        match: fields of the rows, and `table`, the file's name.
    """

    label: str
    metrics: tuple[str, ...]
    match: dict[str, str]

    def cell(self, column: "Column") -> str:
        """Values of one column."""
        found = []
        for metric in self.metrics:
            match = {**self.match, **column.match, "metric": metric}
            file = f"{column.folder}/{match.pop('table')}.json"
            if not find_rows(file, **match):
                return MISSING
            found.append(column.value(find_row(file, **match)))
        return "; ".join(found)


@dataclass(frozen=True)
class Column:
    """A column of a table: folder in `results/`, and fields of its rows."""

    title: str
    folder: str
    match: dict[str, str] = field(default_factory=dict)
    value: Callable[[dict[str, Any]], str] = with_spread


def table_of(
    lines: Sequence[Line],
    columns: Sequence[Column],
    further: Sequence[Sequence[str]] = (),
) -> str:
    """A table of lines and columns, and further lines of cells below."""
    cells = [[line.label, *(line.cell(column) for column in columns)] for line in lines]
    return table(["", *(column.title for column in columns)], [*cells, *further])
