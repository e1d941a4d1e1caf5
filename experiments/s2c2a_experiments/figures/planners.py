"""Figures of the benchmark of planners: profiles of errors, and error over time."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from s2c2a.viz.charts import (
    headline,
    label_log_axis,
    legend,
    new_axes,
    new_figure,
    save_figure,
)
from s2c2a.viz.colors import DESIRED, INK, MUTED

LABELED = 6  # best entrants, whose profiles have colors
LABEL_DISTANCES = (8.0, 14.0, 21.0, 30.0, 42.0)  # points, the nearest that is free
LABEL_DIRECTIONS = (-45, 45, 135, -135, 0, 180, 90, -90)  # deg, in order of preference
POINT = 3.0  # points, half the width that a label keeps clear of
COLORS = ("#1f5fc4", "#2b9a4b", "#c77d0a", "#0d8fa0", "#b8327f", "#7a5230")


def planners_figure(
    errors: Mapping[str, Float[np.ndarray, " runs"]],
    runs: int,
    points: Mapping[str, tuple[float, float]],
    path: str | Path,
) -> Path:
    """Draw the shares of runs below every error, and error over time of a step.

    Args:
        errors: of the runs of every entrant [% of length], the best entrant first; runs
            that an entrant cannot do or that failed are missing.
        runs: number of runs of an entrant that does all tasks.
        points: time of a step [ms] and success, by entrant.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.
    """
    figure = new_figure(11.0, 4.6)
    grid = figure.add_gridspec(1, 2)
    profiles = new_axes(figure, grid[0, 0], "error [% of length]", "share of runs")
    _draw_profiles(profiles, errors, runs)
    time = "time of a control step, median [ms]"
    _draw_pareto(figure, new_axes(figure, grid[0, 1], time, "success"), points)
    legend(figure)
    return save_figure(figure, path)


def _draw_profiles(axes: Axes, errors: Mapping[str, np.ndarray], runs: int) -> None:
    """Performance profiles (Dolan and More, Mathematical Programming 91, 2002)."""
    for number, (name, values) in enumerate(errors.items()):
        if not len(values):
            continue
        shares = np.arange(len(values) + 1) / runs
        style: dict[str, Any] = {"color": MUTED, "linewidth": 0.6, "alpha": 0.5}
        if number < LABELED:
            style = {"color": COLORS[number], "linewidth": 1.6, "label": name}
        places = np.sort(np.append(values, values.min()))
        axes.step(places, shares, where="post", **style)
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.02)
    label_log_axis(axes)
    headline(axes, "How many runs stay below an error")


def _draw_pareto(
    figure: Figure, axes: Axes, points: Mapping[str, tuple[float, float]]
) -> None:
    """Entrants that no other one beats in both are in color, with a line."""
    front = pareto(points)
    colors = {name: DESIRED if name in front else INK for name in points}
    for name, (time, share) in points.items():
        axes.plot(time, share, "o", color=colors[name], markersize=5)
    line = np.array(sorted(points[name] for name in front)).reshape(-1, 2)
    axes.step(line[:, 0], line[:, 1], where="post", color=DESIRED, linewidth=1.0)
    axes.set_xscale("log")
    axes.set_ylim(-0.03, 1.05)
    label_log_axis(axes)
    headline(axes, "Success and time")
    _label(figure, axes, points, colors)


def _label(
    figure: Figure,
    axes: Axes,
    points: Mapping[str, tuple[float, float]],
    colors: Mapping[str, str],
) -> None:
    """Write the names beside the points, where no other point or name is."""
    axes.margins(x=0.2)
    figure.draw_without_rendering()  # the layout decides what overlaps
    pixels = figure.dpi / 72.0
    centers = axes.transData.transform(np.reshape([*points.values()], (-1, 2)))
    taken = [Bbox([center, center]).padded(POINT * pixels) for center in centers]
    angles = np.radians(LABEL_DIRECTIONS)
    places = [
        (distance * np.cos(angle), distance * np.sin(angle))
        for distance in LABEL_DISTANCES
        for angle in angles
    ]
    for name, point in points.items():
        place: dict[str, Any] = {"xytext": (0, 0), "textcoords": "offset points"}
        text = axes.annotate(
            name, point, color=colors[name], fontsize=7, va="center", **place
        )
        for x, y in places:
            text.set_position((x, y))
            text.set_horizontalalignment("left" if x > -1.0 else "right")
            box = text.get_window_extent()
            if not any(box.overlaps(other) for other in taken):
                break
        taken.append(box)
        if np.hypot(x, y) > LABEL_DISTANCES[0] + 1.0:
            place["xytext"] = (x, y)
            line = {"arrowstyle": "-", "color": MUTED, "linewidth": 0.5}
            axes.annotate("", point, arrowprops=line, **place)


def pareto(points: Mapping[str, tuple[float, float]]) -> list[str]:
    """Names of those that no other one beats: less time and more success."""
    names = []
    for name, (time, share) in points.items():
        beaten = any(
            other_time <= time
            and other_share >= share
            and (other_time, other_share) != (time, share)
            for other_time, other_share in points.values()
        )
        if not beaten:
            names.append(name)
    return names
