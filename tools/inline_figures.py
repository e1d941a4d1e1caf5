"""Single figures within sentences: which rows of `results/` each one shows."""

from collections.abc import Callable

from tools.results_tables import find_row, find_rows, number


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


FIGURES: dict[str, Callable[[], str]] = {
    "paths-past-obstacles": _paths_past_obstacles,
    "path-without-obstacles": lambda: f"{number(_path_length('reach-0'), 0)} cm",
    "worst-sensor-fault": lambda: _largest_error("worst error"),
    "worst-recovery": lambda: _largest_error("worst error after recovery"),
}
"""Functions that make a figure, by its name on the pages."""
