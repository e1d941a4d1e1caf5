"""Figures that answer those of the paper in space: a panel for each task (Chen et al. 2025, figures 10 to 13)."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from s2c2a.spaces import AXIS, POSITION
from s2c2a.viz import center_line, charts
from s2c2a.viz.charts import FRONT, padded_limits, seen
from s2c2a.viz.colors import INK, POINTING, DESIRED, colors_by_label, module_colors
from s2c2a.viz.mounting import ABOVE, SIDE, View
from s2c2a.viz.trace import Trace, check_some, check_told_apart

MAX_COLUMNS = 4
AXES_SHOWN = 16
# length of an end axis that lies flat, as a share of the path's width
AXIS_SHARE = 0.22
POSES_SHOWN = 8
POINTS_PER_MODULE = 16
HELD_WITHIN = 0.1  # of the arm's length; an end that should move further is not held


def _panels_figure(
    named: Mapping[str, Any],
    views: Sequence[View],
    height: float,
    draw: Callable[..., None],
    path: str | Path,
) -> Path:
    """Draw what is named, a column each, all views below each other, each `height` inches high.

    Raises:
        S2C2AError: nothing is named, or the file cannot be written.
    """
    check_some(named)
    bands = -(-len(named) // MAX_COLUMNS)
    columns = -(-len(named) // bands)
    rows = len(views)
    figure = charts.new_figure(max(3.6 * columns, 5.0), 0.5 + height * rows * bands)
    grid = figure.add_gridspec(rows * bands, columns)
    for place, (name, one) in enumerate(named.items()):
        band, column = divmod(place, columns)
        for row, view in enumerate(views):
            axes = charts.view_axes(figure, grid[rows * band + row, column], view)
            draw(axes, one, view)
            charts.headline(axes, f"{name}, {charts.NAMES[view]}" if rows > 1 else name)
    return charts.save_figure(figure, path)


def plan_view_figure(named_traces: Mapping[str, Trace], path: str | Path) -> Path:
    """Draw desired and true paths from above, and where the end axis points (figure 10 of the paper).

    A short line from the path is the end axis at that moment as seen from above: the
    longer, the flatter the axis lies.

    Args:
        named_traces: for each task its run, base frame.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: no trace, or the file cannot be written.
    """
    colors = colors_by_label(trace.label for trace in named_traces.values())

    def draw(axes: Axes, trace: Trace, view: View) -> None:
        charts.draw_desired(axes, trace.desired_path, view)
        axes.plot(
            *seen(trace.followed_path, view),
            color=colors[trace.label],
            linewidth=1.4,
            label=trace.label,
        )
        states = trace.states[:, trace.followed_module]
        moments = _even(np.isfinite(states).all(axis=-1), AXES_SHOWN)
        starts = states[moments, :2]
        directions = states[moments, AXIS][:, :2]
        low, high = padded_limits(states[:, :2])
        # (ends, moments, 2)
        lines = np.stack([starts, starts + AXIS_SHARE * (high - low) * directions])
        axes.plot(
            *np.moveaxis(lines, -1, 0),
            color=POINTING,
            linewidth=1.8,
            zorder=1.9,
            label="end axis",
        )
        axes.plot(*starts.T, "o", color=POINTING, markersize=3, zorder=FRONT + 1)

    return _panels_figure(named_traces, (ABOVE,), 3.4, draw, path)


def poses_figure(named_traces: Mapping[str, Trace], path: str | Path) -> Path:
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
        ends = (trace.states[..., POSITION] for trace in named_traces.values())
        _whole_in_sight(axes, [np.zeros(3), *ends], view)
        axes.plot([], [], linestyle="none", label="(the darker, the later)")

    return _panels_figure(named_traces, (SIDE, ABOVE), 3.6, draw, path)


def _whole_in_sight(
    axes: Axes, points: Iterable[Float[np.ndarray, "*batch 3"]], view: View
) -> None:
    """Show at least a box that holds these points."""
    every = np.concatenate([one.reshape(-1, 3) for one in points])
    axes.update_datalim(
        np.transpose([padded_limits(every[:, coordinate]) for coordinate in view])
    )


def _draw_poses(axes: Axes, trace: Trace, view: View) -> None:
    """The arm at moments when all of it was seen, a color and a dot at the end for each module."""
    whole = np.isfinite(trace.states).all(axis=(1, 2))
    if not whole.any():
        charts.say_nothing_here(axes, "the arm was never seen")
        return
    arm = trace.episode.arm
    lengths = np.array([module.length for module in arm.modules])
    lines = center_line(
        trace.states[_even(whole, POSES_SHOWN)], lengths, POINTS_PER_MODULE
    )
    for line, alpha in zip(lines, np.linspace(0.25, 0.95, len(lines)), strict=True):
        for module, color in enumerate(module_colors(arm.module_count)):
            part = line[
                module * POINTS_PER_MODULE : (module + 1) * POINTS_PER_MODULE + 1
            ]
            axes.plot(*seen(part, view), color=color, linewidth=2.2, alpha=alpha)
            axes.plot(
                *seen(part[-1], view),
                "o",
                color=color,
                markersize=4.5,
                alpha=alpha,
                markeredgewidth=0,
            )
            axes.plot([], [], color=color, linewidth=2.2, label=f"module {module + 1}")
    held = _held_place(trace.desired_positions, arm.length)
    if held is not None:
        charts.draw_ring(axes, held, view, 15, "held end")
    axes.plot(0, 0, "s", color=INK, markersize=4.5, zorder=FRONT)


def _held_place(
    desired: Float[np.ndarray, "time modules 3"], length: float
) -> Float[np.ndarray, " 3"] | None:
    """Last desired place of the end that should move least, if that is little."""
    asked = [
        path[np.isfinite(path).all(axis=-1)] for path in np.moveaxis(desired, 1, 0)
    ]
    asked = [path for path in asked if len(path)]
    widths = [np.ptp(path, axis=0).max() for path in asked]
    if not widths or min(widths) > HELD_WITHIN * length:
        return None
    return asked[int(np.argmin(widths))][-1]


def _even(there: np.ndarray, count: int) -> np.ndarray:
    """At most `count` of the steps that are there, evenly spread, first and last among them."""
    steps = np.flatnonzero(there)
    return (
        steps[np.unique(np.linspace(0, len(steps) - 1, count).round().astype(int))]
        if len(steps)
        else steps
    )


def obstacles_figure(
    named_traces: Mapping[str, Trace | Sequence[Trace]], path: str | Path
) -> Path:
    """Draw ways past obstacles to a target, from above and from the side (figures 12 and 13 of the paper).

    A disc round an obstacle is its threshold at the start; all panels show the same
    part of space.

    Args:
        named_traces: for each task its run, or several runs to lay over each other,
            base frame.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: no trace, one label for several runs of a task, or the file cannot
            be written.
    """
    tasks = {
        name: [runs] if isinstance(runs, Trace) else list(runs)
        for name, runs in named_traces.items()
    }
    for runs in tasks.values():
        check_told_apart(runs)
    every = [trace for runs in tasks.values() for trace in runs]
    colors = colors_by_label(trace.label for trace in every)
    spheres = [trace.spheres(0) for trace in every]
    shown = [
        one[:, POSITION] + side * one[:, 3:] for one in spheres for side in (-1, 1)
    ]
    shown += [
        path for trace in every for path in (trace.followed_path, trace.desired_path)
    ]

    def draw(axes: Axes, runs: Sequence[Trace], view: View) -> None:
        charts.draw_obstacles(axes, runs[0].spheres(0), view)
        desired = runs[0].desired_path
        places = desired[np.isfinite(desired).all(axis=-1)]
        if len(places):
            axes.plot(
                *seen(desired, view),
                color=DESIRED,
                lw=1.2,
                ls=(0, (4, 2)),
                alpha=0.75,
                label="desired",
            )
            charts.draw_ring(axes, places[-1], view, 12, "target")
        for place, trace in enumerate(runs):
            charts.draw_run(axes, trace, colors, view, FRONT - 3 * place)
        _whole_in_sight(axes, shown, view)
        if axes is axes.figure.axes[0]:
            charts.name_ends(axes)

    return _panels_figure(tasks, (ABOVE, SIDE), 2.5, draw, path)
