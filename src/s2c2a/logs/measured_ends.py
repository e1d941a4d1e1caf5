"""Figure of the measured ends of an imported log, and of what is wrong with them."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from s2c2a.measurements.outliers import MeasuredEnds, Outliers
from s2c2a.viz.charts import (
    LETTERS_PER_INCH,
    headline,
    new_axes,
    new_figure,
    save_figure,
)
from s2c2a.viz.colors import INK, MUTED, PALETTE, REAL

WIDTH, HEIGHT = 11.0, 2.1  # of the figure, and of the panel of each end [inches]
COORDINATES = {"x": REAL, "y": PALETTE[1], "z": MUTED}
LINE: dict[str, Any] = {"linewidth": 0.7}
BAND: dict[str, Any] = {
    "color": PALETTE[2],
    "alpha": 0.35,
    "label": "frozen pose, excluded",
}
CROSSES: dict[str, Any] = {
    "marker": "x",
    "markersize": 4,
    "linestyle": "none",
    "color": PALETTE[4],
    "label": "other excluded pose",
}


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
        positions = ends.positions[:, end]
        for (name, color), values in zip(COORDINATES.items(), positions.T, strict=True):
            axes.plot(values, color=color, label=name, **LINE)
        if outliers is not None:
            is_frozen = outliers.frozen[:, end]
            # a band over each run of frozen rows, at least a row wide
            edges = np.flatnonzero(np.diff(is_frozen, prepend=False, append=False))
            for first, after in edges.reshape(-1, 2).tolist():
                axes.axvspan(first - 0.5, after - 0.5, **BAND)
            rows = np.flatnonzero(outliers.all[:, end] & ~is_frozen)
            for values in positions[rows].T if len(rows) else ():
                axes.plot(rows, values, **CROSSES)
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
