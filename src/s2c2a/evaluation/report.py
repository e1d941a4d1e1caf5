"""Results: rows that every printed table is made from."""

import csv
import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

from s2c2a.errors import S2C2AError
from s2c2a.files import read_text, save_whole, written_whole

MOST_BYTES = 20_000_000


@dataclass(frozen=True)
class Row:
    """One line of `results.json`.

    `mean` and `std_steps` are over the steps of a run, as in the paper, averaged over seeds; `std_seeds` is the spread
    of the means between seeds.
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


def over_seeds(values: Sequence[float], spreads: Sequence[float] = ()) -> dict[str, Any]:
    """Mean over seeds, mean of the spreads over steps if there are any, and spread between seeds.

    Args:
        values: one number a seed.
        spreads: over the steps of each run.
    """
    between = float(np.std(values, ddof=1)) if len(values) > 1 and np.isfinite(values).all() else None
    steps = float(np.mean(spreads)) if len(spreads) else None
    return {"mean": float(np.mean(values)), "std_steps": steps, "std_seeds": between}


def pair(mean: float, spread: float | None) -> str:
    """A mean and its spread, where there is one, as tables show them."""
    return f"{mean:.2f}" if spread is None else f"{mean:.2f} ± {spread:.2f}"


def save_rows(rows: Iterable[Row], path: str | os.PathLike) -> None:
    """Write `results.json`; numbers that are not finite stand as words, for JSON knows none."""
    written = [{key: _as_word(value) for key, value in asdict(row).items()} for row in rows]
    save_whole(json.dumps(written, indent=1, allow_nan=False) + "\n", path)


def load_rows(path: str | os.PathLike) -> list[Row]:
    """Read what `save_rows` wrote.

    Raises:
        S2C2AError: it is no list of rows.
    """
    try:
        return TypeAdapter(list[Row]).validate_json(read_text(path, most=MOST_BYTES))
    except (S2C2AError, ValidationError) as error:
        raise S2C2AError(f"{path} holds no result rows: {error}; make the table again") from error


def _as_word(value: Any) -> Any:
    return str(value) if isinstance(value, float) and not np.isfinite(value) else value


def save_csv(header: Sequence[str], rows: Iterable[Sequence], path: str | os.PathLike) -> None:
    """Write a table of comma-separated values."""
    with written_whole(path) as part, open(part, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([header, *rows])
