"""Single figures within sentences: which rows of `results/` each one shows."""

import json
from collections.abc import Callable

from tools import ROOT
from tools.page_tables import real_tips
from tools.results_tables import find_row, find_rows, load_rows, number


def _paths_past_obstacles() -> str:
    """Paths of the tip past one and past two spheres [cm]."""
    lengths = [_path_length(task) for task in ("reach-1", "reach-2")]
    return f"{number(min(lengths), 0)} to {number(max(lengths), 0)} cm"


def _path_length(task: str) -> float:
    row = find_row(
        "best/obstacles.json", experiment="obstacles", task=task, metric="path length"
    )
    return row["mean"]


def _largest_error(metric: str) -> str:
    """Over all faults and sensors [cm]."""
    rows = find_rows("sensor-faults/results.json", metric=metric)
    faults = [row["mean"] for row in rows if "healthy" not in row["strategy"]]
    return f"{number(max(faults), 1)} cm"


PAPER_TABLES = ("tracking", "constraint")
NEAR = 1.05  # of the smallest error: as good, within what seeds change


def _as_good_as_the_arm(recipe: str) -> str:
    """Values of a recipe that are at most those of the paper's arm."""
    pairs = [
        (row["mean"], row["paper_mean"])
        for table in PAPER_TABLES
        for row in load_rows(f"{recipe}/{table}.json")
        if row["strategy"] == "s2c2a" and row["paper_mean"] is not None
        if not row["task"].startswith("mean of")
    ]
    return f"{sum(mean <= arm for mean, arm in pairs)} of {len(pairs)}"


def _nearest_to_real_arms(model: str) -> str:
    """Held-out sets on which no model is clearly nearer."""
    tips = real_tips().values()
    near = sum(line[model] <= NEAR * min(line.values()) for line in tips)
    return f"{near} of {len(tips)}"


def _deepest_touch() -> str:
    """Depth of the deepest point of the arm in drawn scenes and crossing spheres."""
    rows = find_rows("scenes/results.json", metric="smallest clearance of the arm")
    depth = max(0.0, -10 * min(row["mean"] for row in rows))
    return f"{number(depth, 1)} mm"


def _hours() -> str:
    """Of all parts together, as each states them."""
    files = (ROOT / "results").glob("*/made.json")
    parts = [json.loads(file.read_text(encoding="utf-8")) for file in files]
    return f"{number(sum(part.get('hours', 0.0) for part in parts), 1)} hours"


FIGURES: dict[str, Callable[[], str]] = {
    "paths-past-obstacles": _paths_past_obstacles,
    "path-without-obstacles": lambda: f"{number(_path_length('reach-0'), 0)} cm",
    "paper-as-good": lambda: _as_good_as_the_arm("paper"),
    "best-as-good": lambda: _as_good_as_the_arm("best"),
    "real-best": lambda: _nearest_to_real_arms("best"),
    "real-process": lambda: _nearest_to_real_arms("process"),
    "deepest-touch": _deepest_touch,
    "hours": _hours,
    "worst-sensor-fault": lambda: _largest_error("worst error"),
    "worst-recovery": lambda: _largest_error("worst error after recovery"),
}
"""Functions that make a figure, by its name on the pages."""
