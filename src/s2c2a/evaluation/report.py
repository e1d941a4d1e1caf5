"""Results: rows, and the tables made of them as files: JSON, Markdown, comma-separated values, LaTeX."""

import csv
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, astuple, dataclass, fields
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool
from pydantic import ConfigDict, TypeAdapter, ValidationError

from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError
from s2c2a.files import read_text, save_whole, written_whole
from s2c2a.kinematics import bends_from_configurations
from s2c2a.spaces import POSITION

MAX_BYTES = 20_000_000
WORTH_A_WORD = 0.01  # of the arm's length
WHOLE_STEP = 0.98  # of the step limit: plans are kept in single precision
_ESCAPED = str.maketrans(
    {"&": r"\&", "%": r"\%", "#": r"\#", "_": r"\_", "±": r"$\pm$"}
)
HEADER = ("task", "metric", "strategy", "here", "± seeds", "beside", "paper")


@dataclass(frozen=True)
class Row:
    """One line of `results.json`.

    `mean` and `std_steps` are over the steps of a run, as in the paper, averaged over
    seeds; `std_seeds` is the spread of the means between seeds.
    """

    experiment: str
    task: str
    arm: str
    fidelity: str
    strategy: str
    recipe: str
    metric: str
    unit: str
    mean: float
    std_steps: float | None = None
    std_seeds: float | None = None
    seeds: tuple[int, ...] = ()
    paper_mean: float | None = None
    paper_std: float | None = None
    first_mode_hz: float | None = None
    damping_ratio: float | None = None

    __pydantic_config__ = ConfigDict(extra="forbid")


def over_seeds(
    values: Sequence[float], spreads: Sequence[float] = ()
) -> dict[str, Any]:
    """Mean over seeds, mean of the spreads over steps if there are any, and spread between seeds.

    Args:
        values: one number a seed.
        spreads: over the steps of each run.
    """
    between = (
        float(np.std(values, ddof=1))
        if len(values) > 1 and np.isfinite(values).all()
        else None
    )
    steps = float(np.mean(spreads)) if len(spreads) else None
    return {"mean": float(np.mean(values)), "std_steps": steps, "std_seeds": between}


def pair(mean: float, spread: float | None) -> str:
    """A mean and its spread, where there is one, as tables show them."""
    return f"{mean:.2f}" if spread is None else f"{mean:.2f} ± {spread:.2f}"


def said_of_plans(episode: Episode) -> str:
    """How often plans were rescued, stood although their cost could fall (`planning.fallback`), doubtful, or held back.

    Held back are those that end a whole step from the last one and still far from what
    is desired.
    """
    least = {
        "rescued": 0.0,
        "standing": 0.0,
        "extrapolation": WORTH_A_WORD * episode.arm.length,
    }
    said = {
        "was rescued": "rescued",
        "stood although its cost could fall": "standing",
        "was at the edge of what the data show, or beyond,": "extrapolation",
    }
    counts = {
        word: int(np.nansum(episode.ran(name) > least[name]))
        for word, name in said.items()
        if name in episode.columns
    }
    held_back = f"was held back by the step limit of {episode.arm.step_limit_deg:g} deg (a slower --pace gives it time)"
    counts[held_back] = int(_held_back(episode).sum())
    return ", ".join(
        f"the plan {word} in {count} steps" for word, count in counts.items() if count
    )


def _held_back(episode: Episode) -> Bool[np.ndarray, " steps"]:
    """Steps that went as far as they may, and whose ends are not where they shall be; none where nobody planned."""
    if not {
        "planned",
        "predicted",
        "desired_positions",
    } <= episode.columns.keys() or not len(episode.running):
        return np.zeros(0, dtype=bool)
    bends = np.asarray(bends_from_configurations(jnp.asarray(episode.ran("planned"))))
    moved = np.linalg.norm(np.diff(bends, axis=0, prepend=bends[:1]), axis=-1).max(
        axis=-1
    )
    missed = np.linalg.norm(
        episode.ran("predicted")[..., POSITION] - episode.ran("desired_positions"),
        axis=-1,
    )
    far = (
        np.where(np.isfinite(missed), missed, 0.0).max(axis=-1)
        > WORTH_A_WORD * episode.arm.length
    )
    return far & (moved > WHOLE_STEP * np.deg2rad(episode.arm.step_limit_deg))


def save_rows(rows: Iterable[Row], path: str | Path) -> None:
    """Write `results.json`; numbers that are not finite stand as words, for JSON knows none."""
    written = [
        {key: _as_word(value) for key, value in asdict(row).items()} for row in rows
    ]
    save_whole(json.dumps(written, indent=1, allow_nan=False) + "\n", path)


def load_rows(path: str | Path) -> list[Row]:
    """Read what `save_rows` wrote.

    Raises:
        S2C2AError: it is no list of rows.
    """
    try:
        return TypeAdapter(list[Row]).validate_json(read_text(path, most=MAX_BYTES))
    except (S2C2AError, ValidationError) as error:
        raise S2C2AError(
            f"{path} holds no result rows: {error}; make the table again"
        ) from error


def _as_word(value: Any) -> Any:
    return str(value) if isinstance(value, float) and not np.isfinite(value) else value


def save_csv(header: Sequence[str], rows: Iterable[Sequence], path: str | Path) -> None:
    """Write a table of comma-separated values."""
    with (
        written_whole(path) as part,
        open(part, "w", newline="", encoding="utf-8") as file,
    ):
        csv.writer(file).writerows([header, *rows])


def save_table(
    name: str, rows: Sequence[Row], folder: Path, beside: Sequence[Row] = ()
) -> Path:
    """Write one table in every form; returns the Markdown file.

    Args:
        name: of the table.
        rows: of it.
        folder: where.
        beside: rows of another recipe, to stand beside.
    """
    save_rows(rows, folder / f"{name}.json")
    save_csv(
        [field.name for field in fields(Row)],
        map(astuple, rows),
        folder / f"{name}.csv",
    )
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


def table_lines(
    rows: Sequence[Row], beside: Sequence[Row] = ()
) -> list[tuple[str, ...]]:
    """Cells of every row, as `HEADER` names them."""
    others = {_key(row): row for row in beside}
    lines: list[tuple[str, ...]] = []
    for row in rows:
        other = others.get(_key(row))
        seeds = "" if row.std_seeds is None else f"{row.std_seeds:.2f}"
        aside = "" if other is None else pair(other.mean, other.std_steps)
        printed = "" if row.paper_mean is None else pair(row.paper_mean, row.paper_std)
        said = (
            f" ({row.experiment.split(', ', 1)[1]})" if ", " in row.experiment else ""
        )
        cells = (
            f"{row.arm}: {row.task}{said}",
            f"{row.metric} [{row.unit}]",
            row.strategy,
        )
        lines.append((*cells, pair(row.mean, row.std_steps), seeds, aside, printed))
    return lines


def _key(row: Row) -> tuple[str, ...]:
    return row.experiment, row.arm, row.task, row.strategy, row.metric


def _markdown(
    name: str,
    rows: Sequence[Row],
    lines: Sequence[tuple[str, ...]],
    beside: Sequence[Row],
) -> str:
    seeds = ", ".join(map(str, sorted({seed for row in rows for seed in row.seeds})))
    recipe = rows[0].recipe if rows else ""
    header = (
        *HEADER[:3],
        f"`{recipe}`",
        HEADER[4],
        f"`{beside[0].recipe}`" if beside else "",
        HEADER[6],
    )
    modes = {row.arm: row for row in rows if row.first_mode_hz is not None}
    said = (
        f"{arm}: first bending mode {row.first_mode_hz:.2f} Hz, damping ratio {row.damping_ratio:.2f}.\n"
        for arm, row in modes.items()
    )
    return f"# {name}, recipe `{recipe}`, seeds {seeds}\n\n{_bars(header, lines)}\n{''.join(said)}"


def _bars(header: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    return "".join(
        f"| {' | '.join(cells)} |\n"
        for cells in (header, ["---"] * len(header), *lines)
    )


def _latex(lines: Sequence[tuple[str, ...]]) -> str:
    body = [
        " & ".join(cell.translate(_ESCAPED) for cell in line) + r" \\"
        for line in (HEADER, *lines)
    ]
    top = r"\begin{tabular}{lll" + "r" * (len(HEADER) - 3) + "}"
    return "\n".join([top, body[0] + r" \hline", *body[1:], r"\end{tabular}"]) + "\n"
