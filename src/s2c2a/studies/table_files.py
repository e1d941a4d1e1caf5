"""Tables as files: Markdown, comma-separated values, LaTeX."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, fields
from pathlib import Path

from s2c2a.evaluation.report import Row, load_rows, pair, save_csv, save_rows
from s2c2a.files import save_whole

_ESCAPED = str.maketrans({"&": r"\&", "%": r"\%", "#": r"\#", "_": r"\_", "±": r"$\pm$"})
HEADER = ("task", "metric", "strategy", "here", "± seeds", "beside", "paper")


def save_table(name: str, rows: Sequence[Row], folder: Path, beside: Sequence[Row] = ()) -> Path:
    """Write one table in every form; returns the Markdown file.

    Args:
        name: of the table.
        rows: of it.
        folder: where.
        beside: rows of another recipe, to stand beside.
    """
    save_rows(rows, folder / f"{name}.json")
    cells = (["" if value is None else str(value) for value in asdict(row).values()] for row in rows)
    save_csv([field.name for field in fields(Row)], cells, folder / f"{name}.csv")
    lines = table_lines(rows, beside)
    save_whole(_latex(lines), folder / f"{name}.tex")
    return save_whole(_markdown(name, rows, lines, beside), folder / f"{name}.md")


def save_across(name: str, rows: Sequence[Row], folder: Path) -> Path:
    """Write means and spreads between seeds, a line a strategy and a column a task and metric; returns the Markdown."""
    save_rows(rows, folder / f"{name}.json")
    columns = list(dict.fromkeys((row.task, row.metric, row.unit) for row in rows))
    values = {(row.strategy, row.task, row.metric): row for row in rows}
    header = ["", *(f"{task}: {metric} [{unit}]" for task, metric, unit in columns)]
    lines = []
    for strategy in dict.fromkeys(row.strategy for row in rows):
        cells = [values[strategy, task, metric] for task, metric, _ in columns]
        lines.append([strategy, *(pair(row.mean, row.std_seeds) for row in cells)])
    return save_whole(_bars(header, lines), folder / f"{name}.md")


def rows_beside(folder: Path | None, name: str) -> list[Row]:
    """Rows of a table that stands in another folder, if there is one."""
    path = None if folder is None else folder / f"{name}.json"
    return load_rows(path) if path is not None and path.is_file() else []


def table_lines(rows: Sequence[Row], beside: Sequence[Row] = ()) -> list[tuple[str, ...]]:
    """Cells of every row, as `HEADER` names them."""
    others = {_key(row): row for row in beside}
    return [_cells(row, others.get(_key(row))) for row in rows]


def _key(row: Row) -> tuple[str, ...]:
    return row.experiment, row.arm, row.task, row.strategy, row.metric


def _cells(row: Row, other: Row | None) -> tuple[str, ...]:
    seeds = "" if row.std_seeds is None else f"{row.std_seeds:.2f}"
    aside = "" if other is None else pair(other.mean, other.std_steps)
    printed = "" if row.paper_mean is None else pair(row.paper_mean, row.paper_std)
    place = f"{row.arm}: {row.task}" + (f" ({row.experiment.split(', ', 1)[1]})" if ", " in row.experiment else "")
    return place, f"{row.metric} [{row.unit}]", row.strategy, pair(row.mean, row.std_steps), seeds, aside, printed


def _markdown(name: str, rows: Sequence[Row], lines: Sequence[tuple[str, ...]], beside: Sequence[Row]) -> str:
    seeds = ", ".join(map(str, sorted({seed for row in rows for seed in row.seeds})))
    recipe = rows[0].recipe if rows else ""
    header = (*HEADER[:3], f"`{recipe}`", HEADER[4], f"`{beside[0].recipe}`" if beside else "", HEADER[6])
    modes = {row.arm: row for row in rows if row.first_mode_hz is not None}
    said = (
        f"{arm}: first bending mode {row.first_mode_hz:.2f} Hz, damping ratio {row.damping_ratio:.2f}.\n"
        for arm, row in modes.items()
    )
    return f"# {name}, recipe `{recipe}`, seeds {seeds}\n\n{_bars(header, lines)}\n{''.join(said)}"


def _bars(header: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    return "".join(f"| {' | '.join(cells)} |\n" for cells in (header, ["---"] * len(header), *lines))


def _latex(lines: Sequence[tuple[str, ...]]) -> str:
    body = [" & ".join(cell.translate(_ESCAPED) for cell in line) + r" \\" for line in (HEADER, *lines)]
    top = r"\begin{tabular}{lll" + "r" * (len(HEADER) - 3) + "}"
    return "\n".join([top, body[0] + r" \hline", *body[1:], r"\end{tabular}"]) + "\n"
