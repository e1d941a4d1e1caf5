"""Figures of runs, recordings, training and searches, set as in the paper (Chen et al. 2025, figures 3 and 6)."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, NullFormatter

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.viz import charts
from s2c2a.viz.charts import headline, new_axes, new_figure, save_figure, seen
from s2c2a.viz.colors import INK, MUTED, DESIRED, colors_by_label, module_colors
from s2c2a.viz.mounting import ABOVE, SIDE, Mounting
from s2c2a.viz.trace import Trace, check_same_arm

POINTS_SHOWN = 60_000
COLUMNS = 3  # of what a search tried
DOT: dict[str, Any] = {
    "marker": "o",
    "linestyle": "none",
    "markersize": 4.5,
    "alpha": 0.75,
    "markeredgewidth": 0,
}
CLOUD: dict[str, Any] = DOT | {
    "marker": ".",
    "markersize": 1.6,
    "alpha": 0.55,
    "rasterized": True,
}


def run_figure(
    traces: Sequence[Trace], arm: ArmSpec, path: str | Path, title: str | None = None
) -> Path:
    """Draw where the followed module's end was and should have been, seen along each axis and from above.

    Desired is red, s2c2a blue, PCC green as in figure 6 of the paper; the error [cm]
    runs along the same time axis.

    Args:
        traces: runs of the same task, base frame.
        arm: the arm that ran them.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.
        title: of what ran; the arm's name if not stated.

    Raises:
        S2C2AError: no trace, a trace of another arm, or the file cannot be written.
    """
    check_same_arm(traces, arm)
    figure = new_figure(11.0, 6.6)
    grid = figure.add_gridspec(4, 2, width_ratios=(1.25, 1.0))
    colors = colors_by_label(trace.label for trace in traces)
    over_time = charts.new_time_axes(
        figure, grid, [*(f"{name} [m]" for name in "xyz"), "error [cm]"]
    )
    view, backward = Mounting.of(arm).flat(ABOVE)
    above = charts.view_axes(figure, grid[:, 1], view, backward)
    for axis, axes in enumerate(over_time[:3]):
        draw_coordinate(axes, traces, axis)
    charts.draw_errors(over_time[3], traces, colors)
    charts.draw_desired(above, traces[0].desired_path, view)
    charts.draw_lines(
        above, traces, colors, lambda trace: seen(trace.followed_path, view)
    )
    charts.draw_obstacles(above, traces[0].spheres(0), view)
    above.plot(0, 0, "+", color=INK, markersize=9, linestyle="none", label="base")
    headline(above, "from above")
    headline(
        over_time[0],
        f"{title or arm.name}: end of module {traces[0].followed_module + 1} of {arm.module_count}",
    )
    return save_figure(figure, path)


def draw_coordinate(axes: Axes, traces: Sequence[Trace], axis: int) -> None:
    """The followed end along one axis over time, where it should have been below it; the first trace in front."""
    charts.draw_over_time(
        axes,
        traces,
        traces[0].desired_path[:, axis],
        lambda trace: trace.followed_path[:, axis],
    )


def recording_figure(
    states: Float[np.ndarray, "samples modules 6"], arm: ArmSpec, path: str | Path
) -> Path:
    """Draw the workspace that a recording covers, a color for each module (figure 3 of the paper).

    Args:
        states: end positions [m] and end axes, shape (samples, modules, 6), base frame.
            Above 60 000 samples an even choice of them is drawn.
        arm: the arm that was recorded; what hangs is drawn hanging.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: the shape is wrong, or the file cannot be written.
    """
    states = np.asarray(states, dtype=float)
    if states.ndim != 3 or states.shape[-1] != 6 or not states.size:
        raise S2C2AError(
            f"states have shape {states.shape}, expected (samples, modules, 6) with at least one of each"
        )
    shown = states[:: -(-len(states) // POINTS_SHOWN)]
    figure = new_figure(11.0, 5.6)
    grid = figure.add_gridspec(1, 2)
    titles = {SIDE: f"from the side, {len(states):,} samples", ABOVE: "from above"}
    for place, (view, title) in zip((grid[0], grid[1]), titles.items(), strict=True):
        near, backward = Mounting.of(arm).flat(view)
        axes = charts.view_axes(figure, place, near, backward)
        count = states.shape[1]
        # inner ones in front, for their clouds are small
        for module, color in enumerate(module_colors(count)):
            look = {
                "color": color,
                "zorder": 2 + count - module,
                "label": f"module {module + 1}",
                **CLOUD,
            }
            axes.plot(*seen(shown[:, module], near), **look)
        axes.plot(0, 0, "+", color=INK, markersize=9, zorder=3 + count)
        headline(axes, title)
    return save_figure(figure, path, markerscale=7)


def learning_curves(curves: Mapping[str, Iterable[Mapping]], path: str | Path) -> Path:
    """Draw how the losses fell: training thin and dashed, validation solid, its least value marked.

    Args:
        curves: for each network its rows, each a mapping with "epoch", "train" and
            "validation".
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: there is no row, a row lacks a key, or the file cannot be written.
    """
    tables = {name: _curve_table(name, rows) for name, rows in curves.items()}
    if not tables:
        raise S2C2AError("there is no learning curve to draw; give at least one")
    figure = new_figure(7.6, 4.6)
    axes = new_axes(figure, figure.add_gridspec(1, 1)[0], "epoch", "loss")
    for name, color in colors_by_label(tables).items():
        epochs, train, validation = tables[name].T
        axes.plot(
            epochs, train, color=color, linewidth=1.0, linestyle=(0, (4, 2)), alpha=0.8
        )
        best = int(np.nanargmin(validation)) if np.isfinite(validation).any() else 0
        axes.plot(
            epochs,
            validation,
            color=color,
            linewidth=1.7,
            label=f"{name}   least {validation[best]:.3g}",
        )
        axes.plot(epochs[best], validation[best], "o", color=color, markersize=4.5)
    if all((table[:, 1:] > 0).all() for table in tables.values()):
        axes.set_yscale("log")
    headline(axes, "validation (solid) and training (dashed)")
    return save_figure(figure, path)


def _curve_table(name: str, rows: Iterable[Mapping]) -> Float[np.ndarray, "epochs 3"]:
    """Epoch, training and validation loss as columns."""
    try:
        table = [
            [float(row[key]) for key in ("epoch", "train", "validation")]
            for row in rows
        ]
    except (KeyError, TypeError, ValueError) as error:
        message = f"curve '{name}': every row needs the numbers epoch, train and validation; got {error!r}"
        raise S2C2AError(message) from error
    if not table:
        raise S2C2AError(f"curve '{name}' has no rows; train for at least one epoch")
    return np.array(table)


def trials_figure(
    numbers: Sequence[int],
    scores: Float[np.ndarray, " trials"],
    values: Mapping[str, Float[np.ndarray, " trials"]],
    label: str,
    logarithmic: Collection[str],
    path: str | Path,
    rises: bool = False,
) -> Path:
    """Draw scores over trials with the best so far, then over each value that was tried; the best trial is red.

    Args:
        numbers: of the trials that did not fail.
        scores: of each.
        values: place -> what was tried in each.
        label: of the scores, with their unit.
        logarithmic: places to be drawn on a logarithmic axis.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.
        rises: whether larger scores are better.

    Raises:
        S2C2AError: there is no trial, or the file cannot be written.
    """
    if not len(numbers):
        raise S2C2AError(
            "there is no finished trial to draw; let at least one come to its end"
        )
    rows = 1 + -(-len(values) // COLUMNS)
    figure = new_figure(11.0, 3.0 * rows)
    grid = figure.add_gridspec(rows, COLUMNS)
    best = int(np.argmax(scores) if rises else np.argmin(scores))
    history = new_axes(figure, grid[0, :], "trial", label)
    so_far = np.maximum.accumulate(scores) if rises else np.minimum.accumulate(scores)
    history.step(numbers, so_far, where="post", color=MUTED, linewidth=1.2)
    history.xaxis.set_major_locator(MaxNLocator(integer=True))
    _dots(history, np.asarray(numbers, float), scores, best)
    headline(history, f"best: {scores[best]:.3g} in trial {numbers[best]}")
    for place, (name, tried) in enumerate(values.items()):
        axes = new_axes(
            figure, grid[1 + place // COLUMNS, place % COLUMNS], name, label
        )
        if name in logarithmic:
            axes.set_xscale("log")
            axes.xaxis.set_minor_formatter(NullFormatter())
        _dots(axes, tried, scores, best)
        headline(axes, f"best at {tried[best]:.4g}")
    return save_figure(figure, path)


def _dots(axes: Axes, places: np.ndarray, scores: np.ndarray, best: int) -> None:
    axes.plot(places, scores, color=INK, **DOT)
    axes.plot(places[best], scores[best], "o", color=DESIRED, markersize=7)
    if scores.min() > 0 and scores.max() > 20 * scores.min():
        axes.set_yscale("log")
