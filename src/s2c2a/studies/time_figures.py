"""Figures that answer those of the paper over time, and its tables (Chen et al. 2025, figures 4, 6 and 8)."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.ticker import MaxNLocator

from s2c2a.errors import S2C2AError
from s2c2a.spaces import AXIS
from s2c2a.viz.chart_style import (
    legend_above,
    new_axes,
    new_figure,
    new_time_axes,
    padded_limits,
    say_nothing_here,
)
from s2c2a.viz.colours import WANTED, trace_colours
from s2c2a.viz.figures import COORDINATES, draw_coordinate
from s2c2a.viz.paths import FRONT, WANTED_LINE
from s2c2a.viz.saving import save_figure
from s2c2a.viz.trace import Trace, check_told_apart

SENSED = "#2b9a4b"
UPRIGHT_DEG = 3.0  # an axis nearer to the vertical than this has no azimuth worth drawing
LEAST_SPAN_DEG = 4.0
BAR_ROOM = 0.8  # of the distance between two labels


def estimation_figure(
    times: Float[np.ndarray, " time"],
    true_deg: Float[np.ndarray, " time"],
    sensed_deg: Float[np.ndarray, " time"],
    path: str | os.PathLike,
) -> Path:
    """Draw one module's bending angle as it was and as its cables said (figure 4 of the paper).

    Args:
        times: [s], shape (time,).
        true_deg: true bending angle [deg], shape (time,); NaN where the arm was not seen.
        sensed_deg: sensed bending angle [deg], shape (time,).
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: the shapes differ, or the file cannot be written.
    """
    times, true_deg, sensed_deg = (np.asarray(values, dtype=float) for values in (times, true_deg, sensed_deg))
    if times.ndim != 1 or not times.size or not times.shape == true_deg.shape == sensed_deg.shape:
        shapes = f"{times.shape}, {true_deg.shape} and {sensed_deg.shape}"
        raise S2C2AError(f"times, true and sensed angles have shapes {shapes}; expected three times (time,)")
    figure = new_figure(7.6, 3.4)
    axes = new_axes(figure, figure.add_gridspec(1, 1)[0], "time [s]", "bending angle [deg]")
    axes.plot(times, true_deg, color=WANTED, linewidth=1.7, label="true")
    axes.plot(times, sensed_deg, color=SENSED, linewidth=1.7, label=_sensed_label(np.abs(sensed_deg - true_deg)))
    axes.margins(x=0.01)
    legend_above(figure)
    return save_figure(figure, path)


def _sensed_label(errors: np.ndarray) -> str:
    errors = errors[np.isfinite(errors)]
    return f"sensed   {errors.mean():.1f}° off on average, {errors.max():.1f}° at most" if errors.size else "sensed"


def coordinates_figure(traces: Sequence[Trace], path: str | os.PathLike) -> Path:
    """Draw x, y and z of the followed end over time, a line for each strategy (figure 6, and that of the simulation).

    Args:
        traces: runs of the same task, base frame, each with a label of its own.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: no trace, one label for several, or the file cannot be written.
    """
    check_told_apart(traces)
    figure = new_figure(7.6, 5.8)
    colours = trace_colours([trace.label for trace in traces])
    over_time = new_time_axes(figure, _rows(figure, 3), [f"{name} [m]" for name in COORDINATES])
    for axis, axes in enumerate(over_time):
        draw_coordinate(axes, traces, colours, axis)
    legend_above(figure)
    return save_figure(figure, path)


def _rows(figure: Figure, count: int) -> list[SubplotSpec]:
    grid = figure.add_gridspec(count, 1)
    return [grid[row, 0] for row in range(count)]


def orientation_figure(traces: Sequence[Trace], path: str | os.PathLike) -> Path:
    """Draw tilt and azimuth [deg] of the end axis over time, wanted and true (figure 8 of the paper).

    Tilt is the angle to the z axis of the base frame, azimuth the angle from x to the axis as seen from above; it is
    left out within 3 deg of the vertical.

    Args:
        traces: runs of the same task, base frame, each with a label of its own.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: no trace, one label for several, or the file cannot be written.
    """
    check_told_apart(traces)
    figure = new_figure(7.6, 4.8)
    tilts, azimuths = new_time_axes(figure, _rows(figure, 2), ["tilt [deg]", "azimuth [deg]"])
    module = traces[0].pointing_module
    wanted = traces[0].wanted_axes[:, module]
    wanted_azimuth = _unwrapped(_azimuth_deg(wanted))
    _draw_angles(tilts, traces, _tilt_deg(wanted), [_tilt_deg(trace.states[:, module, AXIS]) for trace in traces])
    azimuths.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 3, 4.5, 9, 10]))  # 30, 45 or 90 deg
    _draw_angles(azimuths, traces, wanted_azimuth, [_azimuth_like_wanted(trace) for trace in traces])
    legend_above(figure)
    return save_figure(figure, path)


def _draw_angles(axes: Axes, traces: Sequence[Trace], wanted: np.ndarray, angles: Sequence[np.ndarray]) -> None:
    """Angles [deg] over time; the first trace in front."""
    axes.plot(traces[0].times, wanted, label="wanted" if np.isfinite(wanted).any() else None, **WANTED_LINE)
    colours = trace_colours([trace.label for trace in traces])
    for place, (trace, angle, colour) in enumerate(zip(traces, angles, colours, strict=True)):
        style: dict[str, Any] = {"color": colour, "linewidth": 1.4, "zorder": FRONT - place}
        axes.plot(trace.times, angle, label=_named_axis_error(trace), **style)
    every = np.concatenate([wanted, *angles])
    axes.set_ylim(*padded_limits(every, LEAST_SPAN_DEG))
    if not np.isfinite(every).any():
        say_nothing_here(axes, "nothing to see: upright all the time")


def _named_axis_error(trace: Trace) -> str:
    """Label with mean and standard deviation of the angle between wanted and true axis."""
    errors = np.rad2deg(trace.axis_errors[np.isfinite(trace.axis_errors)])
    return f"{trace.label}   {errors.mean():.1f} ± {errors.std():.1f}°" if errors.size else trace.label


def _tilt_deg(axes: Float[np.ndarray, "time 3"]) -> Float[np.ndarray, " time"]:
    return np.rad2deg(np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2]))


def _azimuth_deg(axes: Float[np.ndarray, "time 3"]) -> Float[np.ndarray, " time"]:
    """Between -180 and 180 deg; NaN where the axis is nearly vertical."""
    azimuth = np.rad2deg(np.arctan2(axes[:, 1], axes[:, 0]))
    tilt = _tilt_deg(axes)
    return np.where((tilt > UPRIGHT_DEG) & (tilt < 180 - UPRIGHT_DEG), azimuth, np.nan)


def _azimuth_like_wanted(trace: Trace) -> Float[np.ndarray, " time"]:
    """The true azimuth, in whichever turn is nearest to the wanted one; broken where it would leap across the chart."""
    wanted = _unwrapped(_azimuth_deg(trace.wanted_axes[:, trace.pointing_module]))
    known = np.isfinite(wanted)
    near = np.interp(trace.times, trace.times[known], wanted[known]) if known.any() else np.zeros_like(wanted)
    azimuth = _azimuth_deg(trace.states[:, trace.pointing_module, AXIS])
    azimuth = near + (azimuth - near + 180.0) % 360.0 - 180.0
    leaps = np.abs(np.diff(azimuth, prepend=azimuth[:1])) > 180.0
    return np.where(leaps, np.nan, azimuth)


def _unwrapped(angles_deg: Float[np.ndarray, " time"]) -> Float[np.ndarray, " time"]:
    """Without leaps of a whole turn, across gaps too."""
    unwrapped = angles_deg.copy()
    known = np.isfinite(angles_deg)
    unwrapped[known] = np.unwrap(angles_deg[known], period=360.0)
    return unwrapped
