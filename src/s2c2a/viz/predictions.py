"""Predicted path of the followed end, with twice its predictive standard deviation.

A calibrated deviation covers the error of the prediction about nineteen times in
twenty. The band is that of the first run with a model that has one, so that several
strategies remain readable.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.patches import Circle

from s2c2a.arm.geometry import interpolated
from s2c2a.viz.arrays import Series
from s2c2a.viz.charts import seen
from s2c2a.viz.colors import darker, pale
from s2c2a.viz.mounting import View
from s2c2a.viz.trace import Trace

TUBE_DISCS = 500  # that look like a tube
BEHIND = 0.6  # zorder below lines and above the grid
MAX_BAND = 3.0  # of the largest error: a higher band leaves the panel
LABEL = "predicted ± 2 std"


def draw_bands(
    coordinates: Sequence[Axes], error: Axes, trace: Trace, color: str
) -> None:
    """Shade the coordinates of the predicted end, and its error, over time."""
    for axis, axes in enumerate(coordinates):
        # shade one coordinate of the predicted end [m] over time; limits stay
        path = trace.predicted_path[:, axis]
        width = trace.band
        limits = axes.get_ylim()
        _fill(axes, trace.times, path - width, path + width, color)
        axes.plot(trace.times, path, **_line(color))
        axes.set_ylim(limits)
    # shade the errors [cm] up to twice the predictive standard deviation
    width = 100.0 * trace.band
    _fill(error, trace.times, np.zeros_like(width), width, color)
    largest = 100.0 * np.nanmax(trace.position_errors, initial=0.0)
    band = min(1.05 * np.nanmax(width, initial=0.0), MAX_BAND * largest)
    error.set_ylim(top=max(error.get_ylim()[1], band))


def draw_tube(axes: Axes, trace: Trace, view: View, color: str) -> None:
    """Draw a light tube around the predicted path of the followed end [m]."""
    # discs so close that they form a tube; without NaN
    columns = np.column_stack([trace.predicted_path, trace.band])
    steps = np.arange(len(columns))
    between = np.linspace(0, len(columns) - 1, max(TUBE_DISCS, len(columns)))
    known = interpolated(between, steps, columns)
    known = known[np.isfinite(known).all(axis=-1)]
    points = np.stack(seen(known, view), axis=-1)
    radii = known[:, 3]
    discs = [Circle(*disc) for disc in zip(map(tuple, points), radii, strict=True)]
    # opaque, since overlaps of translucent discs would add up
    style: dict[str, Any] = {"facecolor": pale(color), "edgecolor": "none"}
    collection = PatchCollection(discs, zorder=BEHIND, rasterized=True, **style)
    axes.add_collection(collection)
    axes.plot(*seen(trace.predicted_path, view), **_line(color))


def _line(color: str) -> dict[str, Any]:
    """Look of the predicted path."""
    dashes = (0, (2, 1.5))
    return {
        "color": darker(color),
        "lw": 0.9,
        "linestyle": dashes,
        "label": "predicted",
    }


def _fill(axes: Axes, times: Series, low: Series, high: Series, color: str) -> None:
    style: dict[str, Any] = {"color": pale(color), "linewidth": 0, "zorder": BEHIND}
    axes.fill_between(times, low, high, label=LABEL, **style)
