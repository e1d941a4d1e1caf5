"""Figures that answer those of the paper in space (Chen et al. 2025, figures 10 and 11)."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from s2c2a.spaces import AXIS, POSITION
from s2c2a.studies.panels import panels_figure
from s2c2a.viz.chart_style import padded_limits, say_nothing_here
from s2c2a.viz.colours import INK, POINTING, WANTED, colours_by_label, module_colours
from s2c2a.viz.paths import ABOVE, FRONT, SIDE, View, draw_wanted, seen
from s2c2a.viz.shape import arc_lengths, centre_line
from s2c2a.viz.trace import Trace

AXES_SHOWN = 16
AXIS_SHARE = 0.22  # length of an end axis that lies flat, as a share of the path's width
POSES_SHOWN, POINTS_PER_MODULE = 8, 16
HELD_WITHIN = 0.1  # of the arm's length; an end that should move further is not held


def plan_view_figure(named_traces: Mapping[str, Trace], path: str | os.PathLike) -> Path:
    """Draw wanted and true paths from above, and where the end axis points (figure 10 of the paper).

    A short line from the path is the end axis at that moment as seen from above: the longer, the flatter the axis lies.

    Args:
        named_traces: for each task its run, base frame.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: no trace, or the file cannot be written.
    """
    colours = colours_by_label(trace.label for trace in named_traces.values())

    def draw(axes: Axes, trace: Trace, view: View) -> None:
        draw_wanted(axes, trace.wanted_path, view)
        axes.plot(*seen(trace.followed_path, view), color=colours[trace.label], linewidth=1.4, label=trace.label)
        _draw_end_axes(axes, trace)

    return panels_figure(named_traces, (ABOVE,), 3.4, draw, path)


def _draw_end_axes(axes: Axes, trace: Trace) -> None:
    """The followed end's axis from above, at even steps of time."""
    states = trace.states[:, trace.followed_module]
    moments = _even(np.isfinite(states).all(axis=-1), AXES_SHOWN)
    starts, directions = states[moments, :2], states[moments, AXIS][:, :2]
    low, high = padded_limits(states[:, :2])
    for number, (start, end) in enumerate(zip(starts, starts + AXIS_SHARE * (high - low) * directions, strict=True)):
        label = None if number else "end axis"
        axes.plot(*np.stack([start, end], axis=-1), color=POINTING, linewidth=1.8, zorder=1.9, label=label)
        axes.plot(*start, "o", color=POINTING, markersize=3, zorder=FRONT + 1)


def poses_figure(named_traces: Mapping[str, Trace], path: str | os.PathLike) -> Path:
    """Draw the arm's shape at eight moments from the side and from above, later ones darker (figure 11 of the paper).

    Base module blue, end module red; a disc marks the end that should stay where it is.

    Args:
        named_traces: for each task its run, base frame.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: no trace, or the file cannot be written.
    """

    def draw(axes: Axes, trace: Trace, view: View) -> None:
        _draw_poses(axes, trace, view)
        axes.update_datalim(_common_corners(named_traces.values(), view))
        axes.plot([], [], linestyle="none", label="(the darker, the later)")

    return panels_figure(named_traces, (SIDE, ABOVE), 3.6, draw, path)


def _common_corners(traces: Iterable[Trace], view: View) -> Float[np.ndarray, "2 2"]:
    """Lower left and upper right corner of a box that holds the base and every module end."""
    ends = np.concatenate([np.zeros((1, 3)), *(trace.states[..., POSITION].reshape(-1, 3) for trace in traces)])
    return np.array([padded_limits(ends[:, coordinate]) for coordinate in view]).T


def _draw_poses(axes: Axes, trace: Trace, view: View) -> None:
    """The arm at moments when all of it was seen."""
    whole = np.isfinite(trace.states).all(axis=(1, 2))
    if not whole.any():
        say_nothing_here(axes, "the arm was never seen")
        return
    lengths = arc_lengths(trace.states[whole])
    lines = centre_line(trace.states[_even(whole, POSES_SHOWN)], lengths, POINTS_PER_MODULE)
    for line, alpha in zip(lines, np.linspace(0.25, 0.95, len(lines)), strict=True):
        _draw_pose(axes, line, view, alpha)
    _mark_held(axes, trace, lengths.sum(), view)
    axes.plot(0, 0, "s", color=INK, markersize=4.5, zorder=FRONT)


def _draw_pose(axes: Axes, line: Float[np.ndarray, "points 3"], view: View, alpha: float) -> None:
    """One shape, a colour and a dot at the end for each module."""
    count = (len(line) - 1) // POINTS_PER_MODULE
    for module, colour in enumerate(module_colours(count)):
        part = line[module * POINTS_PER_MODULE : (module + 1) * POINTS_PER_MODULE + 1]
        axes.plot(*seen(part, view), color=colour, linewidth=2.2, alpha=alpha)
        axes.plot(*seen(part[-1], view), "o", color=colour, markersize=4.5, alpha=alpha, markeredgewidth=0)
        axes.plot([], [], color=colour, linewidth=2.2, label=f"module {module + 1}")


def _mark_held(axes: Axes, trace: Trace, length: float, view: View) -> None:
    """A disc where the held end should be, at the last time it is asked for."""
    held = _held_place(trace.wanted_positions, length)
    if held is not None:
        style: dict[str, Any] = {
            "markersize": 15,
            "markerfacecolor": WANTED + "30",
            "markeredgecolor": WANTED,
            "linestyle": "none",
        }
        axes.plot(*seen(held, view), "o", zorder=FRONT, label="held end", **style)


def _held_place(wanted: Float[np.ndarray, "time modules 3"], length: float) -> Float[np.ndarray, " 3"] | None:
    """Last wanted place of the end that should move least, if that is little."""
    asked = [path[np.isfinite(path).all(axis=-1)] for path in np.moveaxis(wanted, 1, 0)]
    asked = [path for path in asked if len(path)]
    widths = [np.ptp(path, axis=0).max() for path in asked]
    if not widths or min(widths) > HELD_WITHIN * length:
        return None
    return asked[int(np.argmin(widths))][-1]


def _even(there: np.ndarray, count: int) -> np.ndarray:
    """At most `count` of the steps that are there, evenly spread, first and last among them."""
    steps = np.flatnonzero(there)
    return steps[np.unique(np.linspace(0, len(steps) - 1, count).round().astype(int))] if len(steps) else steps
