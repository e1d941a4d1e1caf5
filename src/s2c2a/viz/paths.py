"""Paths of module ends, targets and obstacles, seen along one axis of the base frame."""

from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.patches import Circle

from s2c2a.viz.chart_style import new_axes
from s2c2a.viz.colours import MUTED, WANTED
from s2c2a.viz.mounting import View
from s2c2a.viz.trace import Trace, standing

ABOVE, SIDE = (0, 1), (0, 2)
NAMES = {ABOVE: "from above", SIDE: "from the side"}
FRONT = 50  # drawing order of the first trace, the one in front
WANTED_LINE: dict[str, Any] = {"color": WANTED, "linewidth": 2.6, "alpha": 0.75}
OBSTACLE, NOT_COUNTED = "#6b6f86", "#e6eaf0"
STANDING = 1e-6  # m; a target that moves less stands still


def view_axes(figure: Figure, place: SubplotSpec, view: View, backward: tuple[bool, bool] = (False, False)) -> Axes:
    """Axes in metres, at equal scale in both directions; what runs backward grows to the left or downward."""
    right, up = ("xyz"[coordinate] for coordinate in view)
    axes = new_axes(figure, place, f"{right} [m]", f"{up} [m]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.locator_params(nbins=6, steps=[1, 2, 5, 10])
    axes.xaxis.set_inverted(backward[0])
    axes.yaxis.set_inverted(backward[1])
    return axes


def seen(points: Float[np.ndarray, "*batch features"], view: View) -> tuple[Any, Any]:
    """The coordinates that run to the right and upward."""
    return points[..., view[0]], points[..., view[1]]


def draw_wanted(axes: Axes, path: Float[np.ndarray, "time 3"], view: View) -> None:
    """A line for a path, a disc for a place, nothing where nothing is asked."""
    finite = path[np.isfinite(path).all(axis=-1)]
    if len(finite):
        stands = np.ptp(finite, axis=0).max() < STANDING
        axes.plot(*seen(path, view), label="wanted", marker="o" if stands else "", markersize=9, **WANTED_LINE)


def draw_obstacles(axes: Axes, obstacles: Float[np.ndarray, "obstacles 4"], view: View, **style) -> None:
    """Discs as large as the thresholds of the obstacles that are there."""
    look = {"facecolor": OBSTACLE + "33", "edgecolor": OBSTACLE, "linewidth": 1, **style}
    for obstacle in obstacles[standing(obstacles)]:
        axes.add_patch(Circle(seen(obstacle, view), obstacle[3], **look))


def draw_ends(axes: Axes, path: Float[np.ndarray, "time 3"], view: View, colour: str, order: float = FRONT) -> None:
    """A hollow disc where a path begins, a full one where it ends."""
    places = path[np.isfinite(path).all(axis=-1)]
    for place, fill in zip(places[[0, -1]] if len(places) else (), ("white", colour), strict=False):
        axes.plot(*seen(place, view), "o", markersize=5.5, color=colour, markerfacecolor=fill, zorder=order + 1)


def name_ends(axes: Axes) -> None:
    """What the discs of `draw_ends` mean, for the legend."""
    for name, fill in (("start", "white"), ("end", MUTED)):
        axes.plot([], [], "o", markersize=5.5, color=MUTED, markerfacecolor=fill, linestyle="none", label=name)


def shade_uncounted(axes: Axes, trace: Trace) -> None:
    """Shade the steps that do not count in the mean error."""
    for number, (start, end) in enumerate(trace.uncounted_spans):
        axes.axvspan(start, end, color=NOT_COUNTED, linewidth=0, label=None if number else "not counted")


def named_error(trace: Trace) -> str:
    """Label with mean and standard deviation of the error over the steps that count."""
    errors = 100 * trace.counted_errors
    return f"{trace.label}   {errors.mean():.2f} ± {errors.std():.2f} cm" if errors.size else trace.label
