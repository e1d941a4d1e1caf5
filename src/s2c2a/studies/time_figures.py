"""Figures that answer those of the paper over time (Chen et al. 2025, figures 4, 6, 8 and 14)."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from s2c2a.errors import S2C2AError
from s2c2a.evaluation import tilts_deg
from s2c2a.spaces import AXIS, POSITION
from s2c2a.viz import charts
from s2c2a.viz.charts import (
    FRONT,
    OBSTACLE,
    Series,
    new_axes,
    new_figure,
    save_figure,
    seen,
)
from s2c2a.viz.colors import DESIRED, colors_by_label
from s2c2a.viz.figures import draw_coordinate
from s2c2a.viz.mounting import ABOVE
from s2c2a.viz.trace import Trace, check_told_apart, standing

SENSED = "#2b9a4b"
# an axis nearer to the vertical than this has no azimuth worth drawing
UPRIGHT_DEG = 3.0
MIN_SPAN_DEG = 4.0


def estimation_figure(
    times: Series, true_deg: Series, sensed_deg: Series, path: str | Path
) -> Path:
    """Draw one module's bending angle as it was and as its cables said (figure 4 of the paper).

    Args:
        times: [s], shape (time,).
        true_deg: true bending angle [deg], shape (time,); NaN where the arm was not
            seen.
        sensed_deg: sensed bending angle [deg], shape (time,).
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: the shapes differ, or the file cannot be written.
    """
    times, true_deg, sensed_deg = (
        np.asarray(values, dtype=float) for values in (times, true_deg, sensed_deg)
    )
    if (
        times.ndim != 1
        or not times.size
        or not times.shape == true_deg.shape == sensed_deg.shape
    ):
        shapes = f"{times.shape}, {true_deg.shape} and {sensed_deg.shape}"
        raise S2C2AError(
            f"times, true and sensed angles have shapes {shapes}; expected three times (time,)"
        )
    figure = new_figure(7.6, 3.4)
    axes = new_axes(
        figure, figure.add_gridspec(1, 1)[0], "time [s]", "bending angle [deg]"
    )
    axes.plot(times, true_deg, color=DESIRED, linewidth=1.7, label="true")
    off = np.abs(sensed_deg - true_deg)[np.isfinite(sensed_deg - true_deg)]
    said = (
        f"sensed   {off.mean():.1f}° off on average, {off.max():.1f}° at most"
        if off.size
        else "sensed"
    )
    axes.plot(times, sensed_deg, color=SENSED, linewidth=1.7, label=said)
    axes.margins(x=0.01)
    return save_figure(figure, path)


def coordinates_figure(traces: Sequence[Trace], path: str | Path) -> Path:
    """Draw x, y and z of the followed end over time, a line for each strategy (figure 6, and that of the simulation).

    Args:
        traces: runs of the same task, base frame, each with a label of its own.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: no trace, one label for several, or the file cannot be written.
    """
    check_told_apart(traces)
    figure = _stacked(5.8, [f"{name} [m]" for name in "xyz"])
    for axis, axes in enumerate(figure.axes):
        draw_coordinate(axes, traces, axis)
    return save_figure(figure, path)


def orientation_figure(traces: Sequence[Trace], path: str | Path) -> Path:
    """Draw tilt and azimuth [deg] of the end axis over time, desired and true (figure 8 of the paper).

    Tilt is the angle to the z axis of the base frame, azimuth the angle from x to the
    axis as seen from above; it is left out within 3 deg of the vertical.

    Args:
        traces: runs of the same task, base frame, each with a label of its own.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: no trace, one label for several, or the file cannot be written.
    """
    check_told_apart(traces)
    figure = _stacked(4.8, ["tilt [deg]", "azimuth [deg]"])
    tilts, azimuths = figure.axes
    module = traces[0].pointing_module
    desired = tilts_deg(traces[0].desired_axes[:, module])
    _draw_angles(
        tilts, traces, desired, lambda trace: tilts_deg(trace.states[:, module, AXIS])
    )
    # 30, 45 or 90 deg
    azimuths.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 3, 4.5, 9, 10]))
    _draw_angles(azimuths, traces, _desired_azimuth(traces[0]), _azimuth_like_desired)
    return save_figure(figure, path)


def _stacked(height: float, labels: Sequence[str]) -> Figure:
    """A figure of axes below each other, over one time axis."""
    figure = new_figure(7.6, height)
    charts.new_time_axes(figure, figure.add_gridspec(len(labels), 1), labels)
    return figure


def _draw_angles(
    axes: Axes, traces: Sequence[Trace], desired: np.ndarray, angles: Callable
) -> None:
    """Angles [deg] over time; the first trace in front."""
    charts.draw_over_time(
        axes, traces, desired, angles, _named_axis_error, MIN_SPAN_DEG
    )
    if not any(np.isfinite(one).any() for one in (desired, *map(angles, traces))):
        charts.say_nothing_here(axes, "nothing to see: upright all the time")


def _named_axis_error(trace: Trace) -> str:
    """Label with mean and standard deviation of the angle between desired and true axis."""
    return charts.named(trace.label, np.rad2deg(trace.axis_errors), "°", 1)


def _azimuth_deg(axes: Float[np.ndarray, "time 3"]) -> Series:
    """Between -180 and 180 deg; NaN where the axis is nearly vertical."""
    azimuth = np.rad2deg(np.arctan2(axes[:, 1], axes[:, 0]))
    return np.where(
        np.abs(tilts_deg(axes) - 90.0) < 90.0 - UPRIGHT_DEG, azimuth, np.nan
    )


def _azimuth_like_desired(trace: Trace) -> Series:
    """The true azimuth, in whichever turn is nearest to the desired one; broken where it would leap across the chart."""
    desired = _desired_azimuth(trace)
    known = np.isfinite(desired)
    near = (
        np.interp(trace.times, trace.times[known], desired[known])
        if known.any()
        else np.zeros_like(desired)
    )
    azimuth = _azimuth_deg(trace.states[:, trace.pointing_module, AXIS])
    azimuth = near + (azimuth - near + 180.0) % 360.0 - 180.0
    leaps = np.abs(np.diff(azimuth, prepend=azimuth[:1])) > 180.0
    return np.where(leaps, np.nan, azimuth)


def _desired_azimuth(trace: Trace) -> Series:
    """Without leaps of a whole turn, across gaps too."""
    azimuth = _azimuth_deg(trace.desired_axes[:, trace.pointing_module])
    known = np.isfinite(azimuth)
    azimuth[known] = np.unwrap(azimuth[known], period=360.0)
    return azimuth


def interaction_figure(flee: Trace, follow: Trace, path: str | Path) -> Path:
    """Draw how the end flees from an obstacle and follows a target that move (figure 14 of the paper).

    Obstacles are dashed where they begin and full where they end.

    Args:
        flee: a run with an obstacle that moves, base frame.
        follow: a run with a target that moves, base frame.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: the file cannot be written.
    """
    figure = new_figure(11.0, 6.6)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1.0))
    colors = colors_by_label([flee.label, follow.label])
    flight = new_axes(figure, grid[0, 0], "time [s]", "distance to the obstacle [cm]")
    chase = new_axes(figure, grid[1, 0], "time [s]", "distance to the target [cm]")
    views = [charts.view_axes(figure, grid[row, 1], ABOVE) for row in range(2)]
    headlines = ("flee", "follow", "flee, from above", "follow, from above")
    for axes, words in zip((flight, chase, *views), headlines, strict=True):
        charts.headline(axes, words)
    _draw_flight(flight, flee, colors)
    charts.draw_errors(chase, [follow], colors, lambda trace: trace.label)
    chase.margins(x=0.01)
    charts.draw_obstacles(
        views[0], flee.spheres(0), ABOVE, facecolor="none", linestyle=(0, (4, 2))
    )
    charts.draw_obstacles(views[0], flee.spheres(-1), ABOVE)
    centers = np.where(
        standing(flee.obstacles)[..., None], flee.obstacles[..., POSITION], np.nan
    )
    for center in np.moveaxis(centers, 1, 0):
        views[0].plot(
            *seen(center, ABOVE),
            color=OBSTACLE,
            linewidth=1.2,
            linestyle=(0, (1, 1.5)),
            label="obstacle",
        )
        charts.draw_ends(views[0], center, ABOVE, OBSTACLE, order=3)
    charts.draw_desired(views[1], follow.desired_path, ABOVE)
    for axes, trace in zip(views, (flee, follow), strict=True):
        charts.draw_run(axes, trace, colors, ABOVE)
    charts.name_ends(views[1])
    figure.align_ylabels([flight, chase])
    return save_figure(figure, path)


def _draw_flight(axes: Axes, trace: Trace, colors: charts.Colors) -> None:
    """Distance to the obstacle whose threshold is nearest, and that threshold."""
    distances, thresholds = _nearest_obstacle(trace)
    if not np.isfinite(distances).any():
        charts.say_nothing_here(axes, "no obstacle")
        return
    axes.plot(
        trace.times,
        100 * distances,
        color=colors[trace.label],
        linewidth=1.5,
        zorder=FRONT,
    )
    axes.plot(
        trace.times, 100 * thresholds, color=OBSTACLE, linewidth=1.2, label="threshold"
    )
    axes.fill_between(
        trace.times, 0, 100 * thresholds, color=OBSTACLE + "33", linewidth=0
    )
    axes.set_ylim(bottom=0)
    axes.margins(x=0.01)


def _nearest_obstacle(trace: Trace) -> tuple[np.ndarray, np.ndarray]:
    """Distance [m] to the obstacle with the least clearance at each time, and its threshold [m]; NaN where none is."""
    obstacles = np.concatenate(
        [np.full((len(trace.times), 1, 4), np.nan), trace.obstacles], axis=1
    )
    distances = np.linalg.norm(
        trace.followed_path[:, None] - obstacles[..., POSITION], axis=-1
    )
    clearances = np.where(
        standing(obstacles) & np.isfinite(distances),
        distances - obstacles[..., 3],
        np.inf,
    )
    nearest = (np.arange(len(trace.times)), np.argmin(clearances, axis=1))
    there = np.isfinite(clearances[nearest])
    return np.where(there, distances[nearest], np.nan), np.where(
        there, obstacles[..., 3][nearest], np.nan
    )
