"""Figures of quantities over time (Chen et al. 2025, figs. 4, 6, 8 and 14)."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from s2c2a.errors import S2C2AError
from s2c2a.evaluation import tilts_deg
from s2c2a.obstacles import CENTER, CORE, ROW, THRESHOLD, distances
from s2c2a.spaces import AXIS
from s2c2a.viz import charts
from s2c2a.viz.charts import (
    FRONT,
    Series,
    new_axes,
    new_figure,
    save_figure,
    seen,
)
from s2c2a.viz.colors import DESIRED, OBSTACLE, colors_by_label
from s2c2a.viz.figures import draw_coordinate
from s2c2a.viz.mounting import ABOVE
from s2c2a.viz.trace import Trace, standing
from s2c2a_experiments.figures.paths import (
    check_unique_labels,
    draw_ends,
    draw_run,
    label_path_ends,
)

SENSED = "#2b9a4b"
UPRIGHT_DEG = 3.0  # from the vertical; a smaller tilt has no meaningful azimuth
MIN_SPAN_DEG = 4.0


def estimation_figure(
    times: Series, true_deg: Series, sensed_deg: Series, path: str | Path
) -> Path:
    """Draw the true and the sensed bending angle of one module (fig. 4 of the paper).

    Args:
        times: [s], shape (time,).
        true_deg: true bending angle [deg], shape (time,); NaN where unknown.
        sensed_deg: sensed bending angle [deg], shape (time,).
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: the shapes differ, or the file cannot be written.
    """
    times = np.asarray(times, dtype=float)
    true_deg = np.asarray(true_deg, dtype=float)
    sensed_deg = np.asarray(sensed_deg, dtype=float)
    same_shapes = times.shape == true_deg.shape == sensed_deg.shape
    if times.ndim != 1 or not times.size or not same_shapes:
        raise S2C2AError(
            f"times, true and sensed angles have shapes {times.shape}, "
            f"{true_deg.shape} and {sensed_deg.shape}; give the same shape (time,) to "
            "all three, with at least one time"
        )
    figure = new_figure(7.6, 3.4)
    axes = new_axes(figure, 111, "time [s]", "bending angle [deg]")
    axes.plot(times, true_deg, color=DESIRED, linewidth=1.7, label="true")
    errors = np.abs(sensed_deg - true_deg)
    errors = errors[np.isfinite(errors)]
    label = "sensed"
    if errors.size:
        label += (
            f"   error {errors.mean():.1f}° on average, {errors.max():.1f}° at most"
        )
    axes.plot(times, sensed_deg, color=SENSED, linewidth=1.7, label=label)
    axes.margins(x=0.01)
    return save_figure(figure, path)


def coordinates_figure(traces: Sequence[Trace], path: str | Path) -> Path:
    """Draw x, y and z of the followed end over time for each strategy (fig. 6).

    Args:
        traces: runs of the same task, base frame, each with a label of its own.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: no trace, one label for several, or the file cannot be written.
    """
    check_unique_labels(traces)
    figure = _stacked(5.8, [f"{name} [m]" for name in "xyz"])
    for axis, axes in enumerate(figure.axes):
        draw_coordinate(axes, traces, axis)
    return save_figure(figure, path)


def orientation_figure(traces: Sequence[Trace], path: str | Path) -> Path:
    """Draw desired and true tilt and azimuth [deg] of the end axis over time (fig. 8).

    Tilt is the angle to the z axis of the base frame, azimuth the angle from x to the
    axis as seen from above; the azimuth is left out within 3 deg of the vertical.

    Args:
        traces: runs of the same task, base frame, each with a label of its own.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: no trace, one label for several, or the file cannot be written.
    """
    check_unique_labels(traces)
    figure = _stacked(4.8, ["tilt [deg]", "azimuth [deg]"])
    tilts, azimuths = figure.axes
    module = traces[0].pointing_module
    desired = tilts_deg(traces[0].desired_axes[:, module])
    _draw_angles(
        tilts, traces, desired, lambda trace: tilts_deg(trace.states[:, module, AXIS])
    )
    # multiples of 30, 45 or 90 deg
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
    """Draw angles [deg] over time, the first trace in front."""
    charts.draw_over_time(
        axes, traces, desired, angles, _named_axis_error, MIN_SPAN_DEG
    )
    series = [desired, *map(angles, traces)]
    if not np.isfinite(np.concatenate(series)).any():
        charts.write_placeholder(axes, "no azimuth: the axis is always upright")


def _named_axis_error(trace: Trace) -> str:
    """Label with mean and standard deviation of the axis error."""
    return charts.named(trace.label, np.rad2deg(trace.axis_errors), "°", 1)


def _azimuth_deg(axes: Float[np.ndarray, "time 3"]) -> Series:
    """Azimuth between -180 and 180 deg; NaN where the axis is nearly vertical."""
    azimuth = np.rad2deg(np.arctan2(axes[:, 1], axes[:, 0]))
    tilted = np.abs(tilts_deg(axes) - 90.0) < 90.0 - UPRIGHT_DEG
    return np.where(tilted, azimuth, np.nan)


def _azimuth_like_desired(trace: Trace) -> Series:
    """True azimuth in the turn nearest to the desired one; NaN where it would jump."""
    desired = _desired_azimuth(trace)
    known = np.isfinite(desired)
    near = np.zeros_like(desired)
    if known.any():
        near = np.interp(trace.times, trace.times[known], desired[known])
    azimuth = _azimuth_deg(trace.states[:, trace.pointing_module, AXIS])
    azimuth = near + (azimuth - near + 180.0) % 360.0 - 180.0
    jumps = np.abs(np.diff(azimuth, prepend=azimuth[:1])) > 180.0
    return np.where(jumps, np.nan, azimuth)


def _desired_azimuth(trace: Trace) -> Series:
    """Desired azimuth without jumps of a whole turn, also across gaps."""
    azimuth = _azimuth_deg(trace.desired_axes[:, trace.pointing_module])
    known = np.isfinite(azimuth)
    azimuth[known] = np.unwrap(azimuth[known], period=360.0)
    return azimuth


def interaction_figure(flee: Trace, follow: Trace, path: str | Path) -> Path:
    """Draw runs with a moving obstacle and with a moving target (fig. 14 of the paper).

    Obstacles are dashed at their first position and filled at their last.

    Args:
        flee: a run with a moving obstacle, base frame.
        follow: a run with a moving target, base frame.
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
    titles = ("flee", "follow", "flee, from above", "follow, from above")
    for axes, title in zip((flight, chase, *views), titles, strict=True):
        charts.headline(axes, title)
    _draw_flight(flight, flee, colors)
    charts.draw_errors(chase, [follow], colors, lambda trace: trace.label)
    chase.margins(x=0.01)
    charts.draw_obstacles(
        views[0], flee.standing(0), ABOVE, facecolor="none", linestyle=(0, (4, 2))
    )
    charts.draw_obstacles(views[0], flee.standing(-1), ABOVE)
    centers = np.where(
        standing(flee.obstacles)[..., None], flee.obstacles[..., CENTER], np.nan
    )
    for center in np.moveaxis(centers, 1, 0):
        views[0].plot(
            *seen(center, ABOVE),
            color=OBSTACLE,
            linewidth=1.2,
            linestyle=(0, (1, 1.5)),
            label="obstacle",
        )
        draw_ends(views[0], center, ABOVE, OBSTACLE, order=3)
    charts.draw_desired(views[1], follow.desired_path, ABOVE)
    for axes, trace in zip(views, (flee, follow), strict=True):
        draw_run(axes, trace, colors, ABOVE)
    label_path_ends(views[1])
    figure.align_ylabels([flight, chase])
    return save_figure(figure, path)


def _draw_flight(axes: Axes, trace: Trace, colors: charts.Colors) -> None:
    """Draw the distance to the obstacle with the least clearance, and its threshold."""
    distances, thresholds = _nearest_obstacle(trace)
    if not np.isfinite(distances).any():
        charts.write_placeholder(axes, "no obstacle")
        return
    distances = 100 * distances  # cm
    thresholds = 100 * thresholds
    color = colors[trace.label]
    axes.plot(trace.times, distances, color=color, linewidth=1.5, zorder=FRONT)
    axes.plot(trace.times, thresholds, color=OBSTACLE, linewidth=1.2, label="threshold")
    axes.fill_between(trace.times, 0, thresholds, color=OBSTACLE + "33", linewidth=0)
    axes.set_ylim(bottom=0)
    axes.margins(x=0.01)


def _nearest_obstacle(trace: Trace) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the obstacle with the least clearance, and its threshold [m].

    Both are NaN at times without an obstacle.
    """
    count = len(trace.times)
    no_obstacle = np.full((count, 1, ROW), np.nan)
    obstacles = np.concatenate([no_obstacle, trace.obstacles], axis=1)
    path = trace.followed_path[:, None]
    away = distances(path, obstacles[..., CENTER], obstacles[..., CORE])
    thresholds = obstacles[..., THRESHOLD]
    known = standing(obstacles) & np.isfinite(away)
    clearances = np.where(known, away - thresholds, np.inf)
    nearest = (np.arange(count), np.argmin(clearances, axis=1))
    known = known[nearest]
    return (
        np.where(known, away[nearest], np.nan),
        np.where(known, thresholds[nearest], np.nan),
    )
