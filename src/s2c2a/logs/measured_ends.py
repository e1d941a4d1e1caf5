"""Figure of the measured ends of an imported log, and of what is wrong with them."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes

from s2c2a.measurements.outliers import MeasuredEnds, Outliers
from s2c2a.viz.charts import (
    LETTERS_PER_INCH,
    headline,
    new_axes,
    new_figure,
    save_figure,
)
from s2c2a.viz.colors import INK, MUTED

WIDTH, HEIGHT = 11.0, 2.1  # of the figure, and of the panel of each end [inches]
COORDINATES = {"x": "#1f5fc4", "y": "#2b9a4b", "z": "#6b7280"}
FROZEN = "#c77d0a"
OTHER = "#b8327f"
LINE: dict[str, Any] = {"linewidth": 0.7}


class RowMark(NamedTuple):
    """Something that happens at a row, such as a jump of the frame.

    Attributes:
        row: number, from 0 over all logs.
        text: what it is.
    """

    row: int
    text: str


def measured_ends_figure(
    ends: MeasuredEnds,
    modules: Sequence[int],
    outliers: Outliers | None,
    marks: Sequence[RowMark],
    notes: Sequence[str],
    path: str | Path,
) -> Path:
    """Draw the position of every end over the rows, with all excluded poses.

    Bands are frozen poses, crosses other excluded ones, and vertical lines are marks,
    and borders of logs.

    Args:
        ends: as they were measured.
        modules: of the ends.
        outliers: excluded poses of these rows; None if all are kept.
        marks: rows to be marked.
        notes: sentences below the figure.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: the file cannot be written.
    """
    figure = new_figure(WIDTH, HEIGHT * len(modules) + 0.9)
    grid = figure.add_gridspec(len(modules), 1)
    shared: Axes | None = None
    for end, module in enumerate(modules):
        axes = new_axes(figure, grid[end, 0], "row", "position [m]", sharex=shared)
        shared = shared or axes
        axes.label_outer()
        axes.margins(x=0.01)
        _draw_positions(axes, ends.positions[:, end])
        if outliers is not None:
            _draw_frozen(axes, outliers.frozen[:, end])
            others = outliers.all[:, end] & ~outliers.frozen[:, end]
            _draw_others(axes, ends.positions[:, end], others)
        for border in np.flatnonzero(np.diff(ends.stretches)):
            axes.axvline(border + 0.5, color=MUTED, linewidth=0.7, linestyle=":")
        for mark in marks:
            axes.axvline(mark.row, color=INK, linewidth=1.2, label=mark.text)
        # modules count from one in figures
        headline(axes, f"end of module {module + 1}")
    if notes:
        axes.set_xlabel(
            "\n".join(
                [
                    "row",
                    *(fill(note, round(LETTERS_PER_INCH * WIDTH)) for note in notes),
                ]
            ),
            color=INK,
            fontsize=9,
        )
    return save_figure(figure, path)


def _draw_positions(axes: Axes, positions: Float[np.ndarray, "rows 3"]) -> None:
    for (name, color), values in zip(COORDINATES.items(), positions.T, strict=True):
        axes.plot(values, color=color, label=name, **LINE)


def _draw_frozen(axes: Axes, is_frozen: Bool[np.ndarray, " rows"]) -> None:
    """A band over each run of frozen rows, at least a row wide."""
    edges = np.flatnonzero(np.diff(is_frozen, prepend=False, append=False))
    for first, end in edges.reshape(-1, 2).tolist():
        label = "frozen pose, excluded"
        axes.axvspan(first - 0.5, end - 0.5, color=FROZEN, alpha=0.35, label=label)


def _draw_others(
    axes: Axes,
    positions: Float[np.ndarray, "rows 3"],
    is_outlier: Bool[np.ndarray, " rows"],
) -> None:
    rows = np.flatnonzero(is_outlier)
    style: dict[str, Any] = {
        "marker": "x",
        "markersize": 4,
        "linestyle": "none",
        "color": OTHER,
    }
    for values in positions[rows].T if len(rows) else ():
        axes.plot(rows, values, label="other excluded pose", **style)
