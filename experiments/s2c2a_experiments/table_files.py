"""Tables of result rows as files: JSON, CSV and Markdown."""

from collections.abc import Iterable, Sequence
from dataclasses import astuple, fields
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from s2c2a.errors import S2C2AError
from s2c2a.evaluation.report import Row, pair, save_csv, save_rows
from s2c2a.files.text import read_text, write_atomically

MAX_BYTES = 20_000_000  # of a table; the largest of the project has a thousandth
_MARKDOWN_ESCAPES = str.maketrans({char: f"\\{char}" for char in r"\*_[]<>|"})
HEADER = ("task", "metric", "strategy", "result", "± seeds", "compared", "paper")


def save_table(
    name: str, rows: Sequence[Row], folder: Path, beside: Sequence[Row] = ()
) -> Path:
    """Write a table as JSON, CSV and Markdown; return the Markdown file.

    Args:
        name: of the table and its files.
        rows: of the table.
        folder: directory of the files.
        beside: rows of another recipe, for comparison.
    """
    save_rows(rows, folder / f"{name}.json")
    header = [field.name for field in fields(Row)]
    save_csv(header, map(astuple, rows), folder / f"{name}.csv")
    lines = table_lines(rows, beside)
    return write_atomically(_markdown(name, rows, lines, beside), folder / f"{name}.md")


def save_across(name: str, rows: Sequence[Row], folder: Path) -> Path:
    """Write a table with a line a strategy and a column a task and metric.

    Cells hold means and standard deviations between seeds.

    Returns:
        The Markdown file.
    """
    save_rows(rows, folder / f"{name}.json")
    names = [(row.task, row.metric, row.unit) for row in rows]
    columns = list(dict.fromkeys(names))
    cells = {
        (row.strategy, row.task, row.metric): pair(row.mean, row.std_seeds)
        for row in rows
    }
    header = [""]
    for task, metric, unit in columns:
        header.append(f"{task}: {metric} [{unit}]")
    lines = []
    for strategy in dict.fromkeys(row.strategy for row in rows):
        values = [cells[strategy, task, metric] for task, metric, _ in columns]
        lines.append([strategy, *values])
    return write_atomically(markdown_table(header, lines), folder / f"{name}.md")


def load_rows(path: str | Path) -> list[Row]:
    """Read result rows that `save_rows` wrote.

    Raises:
        S2C2AError: the file does not hold a list of rows.
    """
    try:
        return TypeAdapter(list[Row]).validate_json(read_text(path, most=MAX_BYTES))
    except (S2C2AError, ValidationError) as error:
        raise S2C2AError(
            f"{path} does not hold result rows: {error}; make the table again"
        ) from error


def load_comparison(folder: Path | None, name: str) -> list[Row]:
    """Read the rows of a table in another directory; empty if there is none."""
    if folder is None:
        return []
    path = folder / f"{name}.json"
    return load_rows(path) if path.is_file() else []


def table_lines(
    rows: Sequence[Row], beside: Sequence[Row] = ()
) -> list[tuple[str, ...]]:
    """Return the cells of every row, in the order of `HEADER`."""
    others = {_key(row): row for row in beside}
    lines: list[tuple[str, ...]] = []
    for row in rows:
        _, _, detail = row.experiment.partition(", ")
        task = f"{row.arm}: {row.task}" + (f" ({detail})" if detail else "")
        metric = f"{row.metric} [{row.unit}]"
        seeds = "" if row.std_seeds is None else f"{row.std_seeds:.2f}"
        other = others.get(_key(row))
        compared = "" if other is None else pair(other.mean, other.std_steps)
        paper = "" if row.paper_mean is None else pair(row.paper_mean, row.paper_std)
        result = pair(row.mean, row.std_steps)
        lines.append((task, metric, row.strategy, result, seeds, compared, paper))
    return lines


def _key(row: Row) -> tuple[str, ...]:
    return row.experiment, row.arm, row.task, row.strategy, row.metric


def _markdown(
    name: str,
    rows: Sequence[Row],
    lines: Sequence[tuple[str, ...]],
    beside: Sequence[Row],
) -> str:
    numbers = {seed for row in rows for seed in row.seeds}
    seeds = ", ".join(map(str, sorted(numbers)))
    recipe = rows[0].recipe if rows else ""
    header = list(HEADER)
    header[3] = f"`{recipe}`"
    header[5] = f"`{beside[0].recipe}`" if beside else ""
    table = markdown_table(header, lines)
    footer = ""
    modes = {row.arm: row for row in rows if row.first_mode_hz is not None}
    for arm, row in modes.items():
        footer += (
            f"{arm}: first bending mode {row.first_mode_hz:.2f} Hz, "
            f"damping ratio {row.damping_ratio:.2f}.\n"
        )
    return f"# {name}, recipe `{recipe}`, seeds {seeds}\n\n{table}\n{footer}"


def markdown_table(header: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A Markdown table of cells."""
    separator = ["---"] * len(header)
    rows = [
        [cell.replace("|", r"\|") for cell in cells]
        for cells in (header, separator, *lines)
    ]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in rows)


def markdown_escaped(text: str) -> str:
    """Text as Markdown shows it as it is, but code between backquotes."""
    parts = text.split("`")
    parts[::2] = [part.translate(_MARKDOWN_ESCAPES) for part in parts[::2]]
    return "`".join(parts)
