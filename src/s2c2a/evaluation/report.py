"""Results: rows that every printed table is made from."""

import csv
import json
import os
import platform
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

import s2c2a

PACKAGES = ("jax", "equinox", "optax", "mujoco", "numpy")


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
    controller: str
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


def over_seeds(errors: Sequence[Float[np.ndarray, " steps"]]) -> dict[str, Any]:
    """Mean, mean spread over steps, spread of the means between seeds, from the errors of one run a seed."""
    means = [float(np.nanmean(values)) for values in errors]
    spread = float(np.std(means, ddof=1)) if len(means) > 1 else None
    steps = float(np.mean([np.nanstd(values) for values in errors]))
    return {"mean": float(np.mean(means)), "std_steps": steps, "std_seeds": spread}


def versions() -> dict[str, str]:
    """Versions of this package and of those that results depend on."""
    found = {name: version(name) for name in PACKAGES}
    return {"s2c2a": s2c2a.__version__, "python": platform.python_version()} | found


def save_rows(rows: Iterable[Row], path: str | os.PathLike) -> None:
    """Write `results.json`."""
    Path(path).write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n", encoding="utf-8")


def save_csv(header: Sequence[str], rows: Iterable[Sequence], path: str | os.PathLike) -> None:
    """Write a table of comma-separated values."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(rows)
