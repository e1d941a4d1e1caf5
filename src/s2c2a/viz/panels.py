"""Figures with a panel for each task."""

from collections.abc import Mapping

from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from s2c2a.errors import S2C2AError
from s2c2a.viz.chart_style import new_figure

MOST_COLUMNS = 4


def new_panels(named: Mapping, rows: int, height: float) -> tuple[Figure, list[list[SubplotSpec]]]:
    """A figure, and for each name places for `rows` axes below each other, each `height` inches high.

    Raises:
        S2C2AError: nothing is named.
    """
    if not named:
        raise S2C2AError("there is no trace to draw; give at least one")
    bands = -(-len(named) // MOST_COLUMNS)
    columns = -(-len(named) // bands)
    figure = new_figure(max(3.6 * columns, 5.0), 0.5 + height * rows * bands)
    grid = figure.add_gridspec(rows * bands, columns)
    return figure, [_below_each_other(grid, rows, *divmod(place, columns)) for place in range(len(named))]


def _below_each_other(grid, rows: int, band: int, column: int) -> list[SubplotSpec]:
    return [grid[rows * band + row, column] for row in range(rows)]
