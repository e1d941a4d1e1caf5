"""Figures that answer those of the paper on obstacles and moving targets (Chen et al. 2025, figures 12 to 14)."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from s2c2a.spaces import POSITION
from s2c2a.studies.panels import panels_figure
from s2c2a.viz.chart_style import headline, legend_above, new_axes, new_figure, padded_limits, say_nothing_here
from s2c2a.viz.colours import WANTED, colours_by_label
from s2c2a.viz.paths import (
    ABOVE,
    FRONT,
    OBSTACLE,
    SIDE,
    View,
    draw_ends,
    draw_obstacles,
    draw_wanted,
    name_ends,
    seen,
    shade_uncounted,
    view_axes,
)
from s2c2a.viz.saving import save_figure
from s2c2a.viz.trace import Trace, check_told_apart, standing


def obstacles_figure(named_traces: Mapping[str, Trace | Sequence[Trace]], path: str | os.PathLike) -> Path:
    """Draw ways past obstacles to a target, from above and from the side (figures 12 and 13 of the paper).

    A disc round an obstacle is its threshold at the start; all panels show the same part of space.

    Args:
        named_traces: for each task its run, or several runs to lay over each other, base frame.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: no trace, one label for several runs of a task, or the file cannot be written.
    """
    tasks = {name: [runs] if isinstance(runs, Trace) else list(runs) for name, runs in named_traces.items()}
    for runs in tasks.values():
        check_told_apart(runs)
    every = [trace for runs in tasks.values() for trace in runs]
    colours = colours_by_label(trace.label for trace in every)

    def draw(axes: Axes, runs: Sequence[Trace], view: View) -> None:
        draw_obstacles(axes, runs[0].obstacles[0], view)
        _draw_target(axes, runs[0].wanted_path, view)
        for place, trace in enumerate(runs):
            _draw_run(axes, trace, colours[trace.label], view, FRONT - 3 * place)
        axes.update_datalim(_common_corners(every, view))
        if axes is axes.figure.axes[0]:
            name_ends(axes)

    return panels_figure(tasks, (ABOVE, SIDE), 2.5, draw, path)


def _draw_run(axes: Axes, trace: Trace, colour: str, view: View, order: float = FRONT) -> None:
    """Path of the followed end, with its start and end."""
    axes.plot(*seen(trace.followed_path, view), color=colour, linewidth=1.5, zorder=order, label=trace.label)
    draw_ends(axes, trace.followed_path, view, colour, order)


def _draw_target(axes: Axes, wanted: Float[np.ndarray, "time 3"], view: View) -> None:
    """A ring where the target ends, and a thin line of how it goes there."""
    places = wanted[np.isfinite(wanted).all(axis=-1)]
    if len(places):
        axes.plot(*seen(wanted, view), color=WANTED, linewidth=1.2, linestyle=(0, (4, 2)), alpha=0.75, label="wanted")
        style: dict[str, Any] = {
            "markersize": 12,
            "markerfacecolor": WANTED + "40",
            "markeredgecolor": WANTED,
            "linestyle": "none",
        }
        axes.plot(*seen(places[-1], view), "o", label="target", **style)


def _common_corners(traces: Sequence[Trace], view: View) -> Float[np.ndarray, "2 2"]:
    """Lower left and upper right corner of a box that holds every path, target and threshold."""
    spheres = np.concatenate([trace.obstacles[0][standing(trace.obstacles[0])] for trace in traces])
    points = [spheres[:, POSITION] - spheres[:, 3:], spheres[:, POSITION] + spheres[:, 3:]]
    points += [path for trace in traces for path in (trace.followed_path, trace.wanted_path)]
    limits = [padded_limits(np.concatenate(points)[:, coordinate]) for coordinate in view]
    return np.array(limits).T


def interaction_figure(flee: Trace, follow: Trace, path: str | os.PathLike) -> Path:
    """Draw how the end flees from an obstacle and follows a target that move (figure 14 of the paper).

    Args:
        flee: a run with an obstacle that moves, base frame.
        follow: a run with a target that moves, base frame.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: the file cannot be written.
    """
    figure = new_figure(11.0, 6.6)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1.0))
    colours = colours_by_label([flee.label, follow.label])
    _draw_flight(new_axes(figure, grid[0, 0], "time [s]", "distance to the obstacle [cm]"), flee, colours)
    _draw_flight_from_above(view_axes(figure, grid[0, 1], ABOVE), flee, colours[flee.label])
    _draw_chase(new_axes(figure, grid[1, 0], "time [s]", "distance to the target [cm]"), follow, colours)
    above = view_axes(figure, grid[1, 1], ABOVE)
    headline(above, "follow, from above")
    draw_wanted(above, follow.wanted_path, ABOVE)
    _draw_run(above, follow, colours[follow.label], ABOVE)
    name_ends(above)
    figure.align_ylabels(figure.axes[::2])
    legend_above(figure)
    return save_figure(figure, path)


def _draw_flight(axes: Axes, trace: Trace, colours: Mapping[str, str]) -> None:
    """Distance to the obstacle whose threshold is nearest, and that threshold."""
    headline(axes, "flee")
    distances, thresholds = _nearest_obstacle(trace)
    if not np.isfinite(distances).any():
        say_nothing_here(axes, "no obstacle")
        return
    axes.plot(trace.times, 100 * distances, color=colours[trace.label], linewidth=1.5, zorder=FRONT)
    axes.plot(trace.times, 100 * thresholds, color=OBSTACLE, linewidth=1.2, label="threshold")
    axes.fill_between(trace.times, 0, 100 * thresholds, color=OBSTACLE + "33", linewidth=0)
    axes.set_ylim(bottom=0)
    axes.margins(x=0.01)


def _nearest_obstacle(trace: Trace) -> tuple[np.ndarray, np.ndarray]:
    """Distance [m] to the obstacle with the least clearance at each time, and its threshold [m]; NaN where none is."""
    nothing = np.full((len(trace.times), 1, 4), np.nan)
    obstacles = np.concatenate([nothing, trace.obstacles], axis=1)
    distances = np.linalg.norm(trace.followed_path[:, None] - obstacles[..., POSITION], axis=-1)
    clearances = np.where(standing(obstacles) & np.isfinite(distances), distances - obstacles[..., 3], np.inf)
    nearest = (np.arange(len(trace.times)), np.argmin(clearances, axis=1))
    there = np.isfinite(clearances[nearest])
    return np.where(there, distances[nearest], np.nan), np.where(there, obstacles[..., 3][nearest], np.nan)


def _draw_flight_from_above(axes: Axes, trace: Trace, colour: str) -> None:
    """Way of the end and of the obstacles, these dashed where they begin and full where they end."""
    draw_obstacles(axes, trace.obstacles[0], ABOVE, facecolor="none", linestyle=(0, (4, 2)))
    draw_obstacles(axes, trace.obstacles[-1], ABOVE)
    centres = np.where(standing(trace.obstacles)[..., None], trace.obstacles[..., POSITION], np.nan)
    for number, centre in enumerate(np.moveaxis(centres, 1, 0)):
        label = None if number else "obstacle"
        axes.plot(*seen(centre, ABOVE), color=OBSTACLE, linewidth=1.2, linestyle=(0, (1, 1.5)), label=label)
        draw_ends(axes, centre, ABOVE, OBSTACLE, order=3)
    _draw_run(axes, trace, colour, ABOVE)
    headline(axes, "flee, from above")


def _draw_chase(axes: Axes, trace: Trace, colours: Mapping[str, str]) -> None:
    headline(axes, "follow")
    if not np.isfinite(trace.position_errors).any():
        say_nothing_here(axes, "no position is asked for")
        return
    axes.plot(trace.times, 100 * trace.position_errors, color=colours[trace.label], linewidth=1.5)
    shade_uncounted(axes, trace)
    axes.set_ylim(bottom=0)
    axes.margins(x=0.01)
