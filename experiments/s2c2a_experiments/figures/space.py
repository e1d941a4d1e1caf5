"""Figures of paths and poses, a panel a task (Chen et al. 2025, figs. 10 to 13)."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from s2c2a.kinematics import center_line
from s2c2a.obstacles import is_half_space
from s2c2a.spaces import AXIS, POSITION
from s2c2a.viz import charts
from s2c2a.viz.charts import FRONT, padded_limits, seen
from s2c2a.viz.colors import DESIRED, INK, POINTING, colors_by_label, module_colors
from s2c2a.viz.mounting import ABOVE, SIDE, View
from s2c2a.viz.solids import surface
from s2c2a.viz.trace import Trace, check_not_empty
from s2c2a_experiments.figures.paths import (
    check_unique_labels,
    draw_ring,
    draw_run,
    label_path_ends,
)

NAMES = {ABOVE: "from above", SIDE: "from the side"}

MAX_COLUMNS = 4
AXES_SHOWN = 16
AXIS_SHARE = 0.22  # of the path's width; length of a horizontal end axis
POSES_SHOWN = 8
POINTS_PER_MODULE = 16
HELD_WITHIN = 0.1  # of the arm's length; an end with a longer desired path is not held


def _panels_figure(
    named: Mapping[str, Any],
    views: Sequence[View],
    height: float,
    draw: Callable[..., None],
    path: str | Path,
) -> Path:
    """Draw a column for each name, its views below each other, `height` inches high.

    Raises:
        S2C2AError: there is no name, or the file cannot be written.
    """
    check_not_empty(named)
    bands = -(-len(named) // MAX_COLUMNS)
    columns = -(-len(named) // bands)
    rows = len(views)
    figure = charts.new_figure(max(3.6 * columns, 5.0), 0.5 + height * rows * bands)
    grid = figure.add_gridspec(rows * bands, columns)
    for number, (name, runs) in enumerate(named.items()):
        band, column = divmod(number, columns)
        for row, view in enumerate(views):
            axes = charts.view_axes(figure, grid[rows * band + row, column], view)
            draw(axes, runs, view)
            title = f"{name}, {NAMES[view]}" if rows > 1 else name
            charts.headline(axes, title)
    return charts.save_figure(figure, path)


def plan_view_figure(named_traces: Mapping[str, Trace], path: str | Path) -> Path:
    """Draw desired and true paths and the end axis from above (fig. 10 of the paper).

    A short line from the path is the end axis at that moment as seen from above; the
    longer the line, the closer the axis is to horizontal.

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
        moments = _evenly_spread(np.isfinite(states).all(axis=-1), AXES_SHOWN)
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
    """Draw the arm at eight moments from the side and above (fig. 11 of the paper).

    Later shapes are darker. The base module is blue, the end module red; a ring marks
    the module end that should not move.

    Args:
        named_traces: for each task its run, base frame.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: no trace, or the file cannot be written.
    """

    def draw(axes: Axes, trace: Trace, view: View) -> None:
        _draw_poses(axes, trace, view)
        ends = (trace.states[..., POSITION] for trace in named_traces.values())
        _include_points(axes, [np.zeros(3), *ends], view)
        axes.plot([], [], linestyle="none", label="(later shapes are darker)")

    return _panels_figure(named_traces, (SIDE, ABOVE), 3.6, draw, path)


def _include_points(
    axes: Axes, points: Iterable[Float[np.ndarray, "*batch 3"]], view: View
) -> None:
    """Extend the limits of the axes to a box around the points."""
    all_points = np.concatenate([array.reshape(-1, 3) for array in points])
    limits = [padded_limits(all_points[:, coordinate]) for coordinate in view]
    axes.update_datalim(np.transpose(limits))


def _draw_poses(axes: Axes, trace: Trace, view: View) -> None:
    """Draw the arm at moments when all states are known, a color for each module."""
    known = np.isfinite(trace.states).all(axis=(1, 2))
    if not known.any():
        charts.write_placeholder(axes, "the shape of the arm was not recorded")
        return
    arm = trace.episode.arm
    lengths = np.array([module.length for module in arm.modules])
    states = trace.states[_evenly_spread(known, POSES_SHOWN)]
    to_ends = center_line(states, lengths, POINTS_PER_MODULE)
    base = np.zeros((len(states), 1, 3))
    lines = np.concatenate([base, to_ends], axis=1)
    for line, alpha in zip(lines, np.linspace(0.25, 0.95, len(lines)), strict=True):
        for module, color in enumerate(module_colors(arm.module_count)):
            start = module * POINTS_PER_MODULE
            segment = line[start : start + POINTS_PER_MODULE + 1]
            style = {"color": color, "alpha": alpha}
            axes.plot(*seen(segment, view), linewidth=2.2, **style)
            end = seen(segment[-1], view)
            axes.plot(*end, "o", markersize=4.5, markeredgewidth=0, **style)
            axes.plot([], [], color=color, linewidth=2.2, label=f"module {module + 1}")
    held = _held_position(trace.desired_positions, arm.length)
    if held is not None:
        draw_ring(axes, held, view, 15, "held end")
    axes.plot(0, 0, "s", color=INK, markersize=4.5, zorder=FRONT)


def _held_position(
    desired: Float[np.ndarray, "time modules 3"], length: float
) -> Float[np.ndarray, " 3"] | None:
    """Last desired position of the end with the shortest desired path, if held."""
    best = None
    smallest = HELD_WITHIN * length
    for path in np.moveaxis(desired, 1, 0):
        known = path[np.isfinite(path).all(axis=-1)]
        if len(known) == 0:
            continue
        width = np.ptp(known, axis=0).max()
        if width < smallest or (best is None and width == smallest):
            best = known[-1]
            smallest = width
    return best


def _evenly_spread(mask: np.ndarray, count: int) -> np.ndarray:
    """At most `count` of the marked steps, evenly spread, including first and last."""
    steps = np.flatnonzero(mask)
    if len(steps) == 0:
        return steps
    places = np.linspace(0, len(steps) - 1, count).round().astype(int)
    return steps[np.unique(places)]


def obstacles_figure(
    named_traces: Mapping[str, Trace | Sequence[Trace]], path: str | Path
) -> Path:
    """Draw paths around obstacles from above and the side (figs. 12 and 13).

    An obstacle is drawn as of the start, with its threshold; all panels show the same
    part of space.

    Args:
        named_traces: for each task its run, or several runs in one panel,
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
        check_unique_labels(runs)
    traces = [trace for runs in tasks.values() for trace in runs]
    colors = colors_by_label(trace.label for trace in traces)
    shown: list[Float[np.ndarray, "points 3"]] = []
    for trace in traces:
        obstacles = trace.standing(0)
        shown.extend(surface(row, 0.0) for row in obstacles if not is_half_space(row))
        shown.append(trace.followed_path)
        shown.append(trace.desired_path)

    def draw(axes: Axes, runs: Sequence[Trace], view: View) -> None:
        charts.draw_obstacles(axes, runs[0].standing(0), view)
        desired = runs[0].desired_path
        known = desired[np.isfinite(desired).all(axis=-1)]
        if len(known):
            axes.plot(
                *seen(desired, view),
                color=DESIRED,
                lw=1.2,
                ls=(0, (4, 2)),
                alpha=0.75,
                label="desired",
            )
            draw_ring(axes, known[-1], view, 12, "target")
        for number, trace in enumerate(runs):
            draw_run(axes, trace, colors, view, FRONT - 3 * number)
        _include_points(axes, shown, view)
        if axes is axes.figure.axes[0]:
            label_path_ends(axes)

    return _panels_figure(tasks, (ABOVE, SIDE), 2.5, draw, path)
