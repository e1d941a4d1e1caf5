"""Paths of module ends in the views of the paper's figures."""

from collections.abc import Collection
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from s2c2a.errors import S2C2AError
from s2c2a.viz.arrays import Point, Points
from s2c2a.viz.charts import FRONT, Colors, seen
from s2c2a.viz.colors import DESIRED, MUTED
from s2c2a.viz.mounting import View
from s2c2a.viz.trace import Trace, check_not_empty


def draw_ends(
    axes: Axes,
    path: Points,
    view: View,
    color: str,
    order: float = FRONT,
) -> None:
    """Draw a hollow disc at the start of a path and a filled one at its end."""
    finite = path[np.isfinite(path).all(axis=-1)]
    if not len(finite):
        return
    for point, fill in ((finite[0], "white"), (finite[-1], color)):
        _draw_end(axes, *seen(point, view), color, fill, zorder=order + 1)


def draw_run(
    axes: Axes, trace: Trace, colors: Colors, view: View, order: float = FRONT
) -> None:
    """Draw the path of the followed module's end with its start and end."""
    path = trace.followed_path
    color = colors[trace.label]
    axes.plot(
        *seen(path, view), color=color, linewidth=1.5, zorder=order, label=trace.label
    )
    draw_ends(axes, path, view, color, order)


def label_path_ends(axes: Axes) -> None:
    """Add the discs of `draw_ends` to the legend."""
    for label, fill in (("start", "white"), ("end", MUTED)):
        _draw_end(axes, [], [], MUTED, fill, linestyle="none", label=label)


def _draw_end(axes: Axes, x, y, color: str, fill: str, **style) -> None:
    axes.plot(x, y, "o", markersize=5.5, color=color, markerfacecolor=fill, **style)


def draw_ring(axes: Axes, place: Point, view: View, size: float, label: str) -> None:
    """Draw a ring around a desired point, with a diameter in points."""
    style: dict[str, Any] = {
        "markersize": size,
        "markerfacecolor": DESIRED + "38",
        "markeredgecolor": DESIRED,
    }
    axes.plot(*seen(place, view), "o", linestyle="none", label=label, **style)


def check_unique_labels(traces: Collection[Trace]) -> None:
    """Check that there is at least one trace and that all labels differ.

    Raises:
        S2C2AError: there is no trace, or two have the same label.
    """
    check_not_empty(traces)
    labels = set()
    for trace in traces:
        if trace.label in labels:
            raise S2C2AError(
                f"several traces are labeled '{trace.label}'; give each its own label"
            )
        labels.add(trace.label)
