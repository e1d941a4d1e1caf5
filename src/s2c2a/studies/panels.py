"""Figures with a panel for each task, seen from one side or several."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from matplotlib.axes import Axes

from s2c2a.errors import S2C2AError
from s2c2a.viz.chart_style import headline, legend_above, new_figure
from s2c2a.viz.paths import NAMES, View, view_axes
from s2c2a.viz.saving import save_figure

MOST_COLUMNS = 4

Drawn = TypeVar("Drawn")


def panels_figure(
    named: Mapping[str, Drawn],
    views: Sequence[View],
    height: float,
    draw: Callable[[Axes, Drawn, View], None],
    path: str | os.PathLike,
) -> Path:
    """Draw what is named, a column each, all views below each other, each `height` inches high.

    Raises:
        S2C2AError: nothing is named, or the file cannot be written.
    """
    if not named:
        raise S2C2AError("there is no trace to draw; give at least one")
    bands = -(-len(named) // MOST_COLUMNS)
    columns, rows = -(-len(named) // bands), len(views)
    figure = new_figure(max(3.6 * columns, 5.0), 0.5 + height * rows * bands)
    grid = figure.add_gridspec(rows * bands, columns)
    for place, (name, one) in enumerate(named.items()):
        band, column = divmod(place, columns)
        for row, view in enumerate(views):
            axes = view_axes(figure, grid[rows * band + row, column], view)
            draw(axes, one, view)
            headline(axes, f"{name}, {NAMES[view]}" if rows > 1 else name)
    legend_above(figure)
    return save_figure(figure, path)
