"""Figures of the benchmark of planners: profiles of errors, and success over time."""

from collections.abc import Collection, Mapping, Sequence
from itertools import product
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

Points = Mapping[str, tuple[float, float]]

LABELED = 6  # entrants whose profiles have colors: the user's, and the best
LABEL_DISTANCES = (8.0, 14.0, 21.0, 30.0, 42.0)  # points, the nearest that is free
LABEL_DIRECTIONS = (-45, 45, 135, -135, 0, 180, 90, -90)  # deg, in order of preference
LABEL_MARGIN = 0.2  # of the axis, beside the points at both ends
POINT = 3.0  # points, half the width that a label keeps clear of
POINTS_PER_INCH = 72.0
COLORS = ("#1f5fc4", "#2b9a4b", "#c77d0a", "#0d8fa0", "#b8327f", "#7a5230")


def planners_figure(
    errors: Mapping[str, Float[np.ndarray, " runs"]],
    runs: int,
    points: Points,
    path: str | Path,
    own: Sequence[str] = (),
    partial: Collection[str] = (),
) -> Path:
    """Draw the shares of runs below every error, and success over time of a step.

    Args:
        errors: of the runs of every entrant [% of length], the best entrant first; runs
            that an entrant cannot do or that failed are missing.
        runs: number of runs of an entrant that does all tasks.
        points: time of a step [ms] and success, by entrant.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.
        own: names of the user's entrants, which have colors like the best.
        partial: names of entrants that do not run on all arms, whose times are of other
            runs: their points are hollow, and no line compares them.
    """
    figure = new_figure(11.0, 4.6)
    grid = figure.add_gridspec(1, 2)
    profiles = new_axes(figure, grid[0, 0], "error [% of length]", "share of runs")
    colored = [*own, *(name for name in errors if name not in own)][:LABELED]
    _draw_profiles(profiles, errors, runs, colored)
    time = "time of a control step, median [ms]"
    pareto_axes = new_axes(figure, grid[0, 1], time, "success")
    comparable = {name: points[name] for name in points if name not in partial}
    front = pareto(comparable)
    _draw_pareto(pareto_axes, points, front, partial)
    legend(figure)
    _label(figure, pareto_axes, points, front)
    return save_figure(figure, path)


def _draw_profiles(
    axes: Axes, errors: Mapping[str, np.ndarray], runs: int, colored: Sequence[str]
) -> None:
    """Performance profiles (Dolan and More, Mathematical Programming 91, 2002)."""
    colors = dict(zip(colored, COLORS, strict=False))
    for name, values in errors.items():
        if not len(values):
            continue
        shares = np.arange(len(values) + 1) / runs
        style: dict[str, Any] = {"color": MUTED, "linewidth": 0.6, "alpha": 0.5}
        if name in colors:
            style = {"color": colors[name], "linewidth": 1.6, "label": name}
        places = np.sort(np.append(values, values.min()))
        axes.step(places, shares, where="post", **style)
    if len(errors) > len(colored):
        axes.plot([], [], color=MUTED, linewidth=0.6, alpha=0.5, label="others")
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.02)
    label_log_axis(axes)
    headline(axes, "How many runs stay below an error")


def _draw_pareto(
    axes: Axes,
    points: Points,
    front: Collection[str],
    partial: Collection[str],
) -> None:
    """Entrants that no other one beats in both are in color, with a line."""
    for name, (time, share) in points.items():
        fill = "none" if name in partial else _color(name, front)
        look: dict[str, Any] = {"color": _color(name, front), "markerfacecolor": fill}
        axes.plot(time, share, "o", markersize=5, **look)
    if partial:
        hollow: dict[str, Any] = {"color": INK, "markerfacecolor": "none"}
        axes.plot([], [], "o", markersize=5, label="not on all arms", **hollow)
    ends = sorted(points[name] for name in front)
    line = np.array(ends).reshape(-1, 2)
    axes.step(
        line[:, 0],
        line[:, 1],
        where="post",
        color=DESIRED,
        linewidth=1.0,
        label="beaten by none in both",
    )
    axes.set_xscale("log")
    axes.margins(x=LABEL_MARGIN)
    axes.set_ylim(-0.03, 1.05)
    label_log_axis(axes)
    headline(axes, "Success and time")


def _color(name: str, front: Collection[str]) -> str:
    return DESIRED if name in front else INK


def _label(
    figure: Figure,
    axes: Axes,
    points: Points,
    front: Collection[str],
) -> None:
    """Write the names beside the points, if possible where no point or name is."""
    figure.draw_without_rendering()  # the layout decides what overlaps
    places = np.reshape([*points.values()], (-1, 2))
    centers = axes.transData.transform(places)
    width = POINT * figure.dpi / POINTS_PER_INCH
    taken = [Bbox([center, center]).padded(width) for center in centers]
    for name, point in points.items():
        text = axes.annotate(
            name,
            point,
            xytext=(0, 0),
            textcoords="offset points",
            color=_color(name, front),
            fontsize=7,
            va="center",
        )
        text.set_in_layout(False)  # which would move what is placed
        for distance, direction in product(LABEL_DISTANCES, LABEL_DIRECTIONS):
            angle = np.radians(direction)
            text.set_position((distance * np.cos(angle), distance * np.sin(angle)))
            text.set_horizontalalignment("right" if abs(direction) > 90 else "left")
            box = text.get_window_extent()
            if box.x1 <= figure.bbox.x1 and not any(
                box.overlaps(other) for other in taken
            ):
                break
        taken.append(text.get_window_extent().padded(width))
        if distance > LABEL_DISTANCES[0]:
            axes.annotate(
                "",
                point,
                xytext=text.get_position(),
                textcoords="offset points",
                arrowprops={"arrowstyle": "-", "color": MUTED, "linewidth": 0.5},
            ).set_in_layout(False)


def pareto(points: Points) -> list[str]:
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
