"""Which way gravity points, seen beside the arm."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from s2c2a.viz.colours import INK, MUTED


def draw_gravity(axes: Axes, gravity: tuple[float, float, float]) -> None:
    """Draw gravity in the x-z plane of the base frame, as an arrow or, where it crosses the page, as a ring."""
    axes.set(xlim=(-1, 1), ylim=(-1, 1), aspect="equal")
    x, y, z = gravity
    for direction, name in (((0.38, 0.0), "x"), ((0.0, 0.38), "z")):
        _draw_axis(axes, direction, name)
    if np.hypot(x, z) > 0.1:
        arrow = {"arrowstyle": "-|>", "color": INK, "lw": 2.2, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 15}
        axes.annotate("", xy=(0.75 * x, 0.75 * z), xytext=(0, 0), arrowprops=arrow, zorder=3)
    elif y:
        _draw_through_page(axes, into=y > 0)
    axes.text(-0.95, 0, _mounting(*gravity), fontsize=8.5, color=INK, ha="right", va="center", linespacing=1.3)


def _draw_axis(axes: Axes, end: tuple[float, float], name: str) -> None:
    axes.annotate("", xy=end, xytext=(0, 0), arrowprops={"arrowstyle": "-", "color": MUTED, "lw": 0.8})
    axes.text(1.35 * end[0], 1.35 * end[1], name, fontsize=7.5, color=MUTED, ha="center", va="center")


def _draw_through_page(axes: Axes, into: bool) -> None:
    """A ring with the tail (into the page, +y) or the tip of an arrow."""
    axes.add_patch(Circle((0, 0), 0.16, facecolor="white", edgecolor=INK, linewidth=1.8, zorder=3))
    axes.plot(0, 0, "x" if into else "o", color=INK, markersize=6 if into else 4, zorder=4)


def _mounting(x: float, y: float, z: float) -> str:
    """How the arm is mounted, in words."""
    if x == y == z == 0:
        return "no gravity"
    if abs(z) < 0.3:
        return "gravity\nthe arm lies"
    return "gravity\nthe arm stands" if z < 0 else "gravity\nthe arm hangs"
