"""Figure of the reach of an arm at rest: where an end can be, targets, nearest shape."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import center_line, name_of_end
from s2c2a.goals import Goal
from s2c2a.planning.reach import Reached
from s2c2a.spaces import CENTER_LINE_POINTS, POSITION, States
from s2c2a.viz import charts
from s2c2a.viz.arrays import Points
from s2c2a.viz.colors import DESIRED, INK, MUTED, REAL, module_colors, pale
from s2c2a.viz.mounting import View

GAP = 0.04  # of the arm's length, chosen by eye: narrower gaps are no holes
# turns about the axis that positions are repeated at, between directions of the table;
# gravity changes positions by millimeters over them
TURNS = Rotation.from_rotvec(np.deg2rad(np.outer(np.arange(-12, 13, 4), (0, 0, 1))))


def reach_figure(
    arm: ArmSpec, states: States, goals: Goal, reached: Reached, path: str | Path
) -> Path:
    """Draw where a module's end can be at rest, from the side and from above.

    Pale is the projection of all positions. With one target, the slice through it is
    darker: a target in the pale area alone lies beside the reach. The line of the arm is
    the shape nearest to the target that is missed by most.

    Args:
        arm: the arm.
        states: of shapes spread over all bends (`Reachability.shapes`), base frame.
        goals: with the targets as first axis, for one or several modules.
        reached: the nearest shapes.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: the name has another ending, or the file cannot be written.
    """
    module = int(np.flatnonzero(goals.position_weights.any(axis=0))[-1])
    figure = charts.new_figure(11.0, 5.0)
    title = f"{arm.name}, from the side"
    for axes, nearest in charts.side_and_above(figure, arm, title):
        _draw_regions(axes, states[:, module, POSITION], goals, module, arm, nearest)
        spheres = goals.obstacles_in_use()[0]
        charts.draw_obstacles(axes, spheres, nearest, label="obstacle", zorder=20)
        _draw_shape(axes, arm, reached, nearest)
        # mark targets that are reached and those that are missed
        targets = goals.desired_positions()
        is_reached = reached.within(arm.length)
        size = 9.0 if len(targets) == 1 else 4.0  # points
        kinds = {
            "target, reached": ("o", DESIRED, is_reached),
            "target, missed": ("x", INK, ~is_reached),
        }
        for label, (marker, color, chosen) in kinds.items():
            if chosen.any():
                points = charts.seen(targets[chosen].reshape(-1, 3), nearest)
                look: dict[str, Any] = {"color": color, "markersize": size}
                axes.plot(*points, marker, label=label, zorder=60, **look)
    return charts.save_figure(figure, path)


def _draw_regions(
    axes: Axes, ends: Points, goals: Goal, module: int, arm: ArmSpec, view: View
) -> None:
    """Draw the projection of all ends, and those beside the only target."""
    label = f"{name_of_end(arm, module)} at rest"
    # points with their copies, turned about the base's z axis
    ends = np.concatenate([turn.apply(ends) for turn in TURNS])
    _draw_region(axes, ends[:, view], arm.length, pale(REAL, 0.86), label)
    if len(goals.positions) > 1:
        return
    (depth,) = {0, 1, 2} - set(view)
    distances = np.abs(ends[:, depth] - goals.positions[0, module, depth])
    beside = ends[distances < GAP * arm.length]
    label = f"within {100 * GAP * arm.length:.1f} cm of the target's plane"
    _draw_region(axes, beside[:, view], arm.length, pale(REAL, 0.62), label)


def _draw_region(
    axes: Axes, points: Float[np.ndarray, "n 2"], length: float, color: str, label: str
) -> None:
    """Fill the area that points cover, with gaps between them closed."""
    axes.plot([], [], "s", markersize=9, color=color, label=label)
    if not len(points):
        return
    gap = GAP * length
    cell = gap / 6.0
    edges = [
        np.arange(side.min() - 2.0 * gap, side.max() + 2.0 * gap + cell, cell)
        for side in points.T
    ]
    counts, *_ = np.histogramdd(points, bins=edges)
    # widened by the gap, and narrowed again
    widened = distance_transform_edt(counts == 0.0) <= gap / cell
    closed = distance_transform_edt(widened) > gap / cell
    area = gaussian_filter(closed.astype(float), 0.6 * gap / cell)
    x, y = (side[:-1] + cell / 2.0 for side in edges)
    axes.contourf(x, y, area.T, [0.5, 1.5], colors=[color])


def _draw_shape(axes: Axes, arm: ArmSpec, reached: Reached, view: View) -> None:
    """Draw the arm at the target that is missed by most, one color for each module."""
    states = np.asarray(reached.states[reached.position_errors.argmax()], float)
    count = 4 * CENTER_LINE_POINTS  # of a module: a smooth line
    line = center_line(states, ArmGeometry.of(arm).lengths, count)
    points = np.concatenate([np.zeros((1, 3)), line])
    for number, color in enumerate(module_colors(arm.module_count)):
        begin = number * count
        part = points[begin : begin + count + 1]
        style: dict[str, Any] = {"linewidth": 4.0, "solid_capstyle": "round"}
        axes.plot(*charts.seen(part, view), color=color, zorder=40, **style)
    ends = points[count::count]
    axes.plot(*charts.seen(ends, view), "o", markersize=3.5, color="white", zorder=41)
    axes.plot([], [], color=color, linewidth=4.0, label="nearest shape")
    axes.plot(0.0, 0.0, "s", markersize=8, color=MUTED, label="base", zorder=42)
