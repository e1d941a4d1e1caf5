"""Figures of runs, recordings and training.

Runs and recordings look like figures 6 and 3 of Chen et al. 2025.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.spaces import States
from s2c2a.viz import charts, predictions
from s2c2a.viz.charts import headline, new_axes, new_figure, save_figure, seen
from s2c2a.viz.colors import INK, colors_by_label, module_colors
from s2c2a.viz.mounting import ABOVE, Mounting
from s2c2a.viz.trace import Trace, check_same_arm

MAX_SAMPLES = 60_000  # more than the 36,000 of `best-long`
CLOUD: dict[str, Any] = {
    "marker": ".",
    "linestyle": "none",
    "markersize": 1.6,
    "alpha": 0.55,
    "markeredgewidth": 0,
    "rasterized": True,
}
CROSS: dict[str, Any] = {
    "marker": "+",
    "linestyle": "none",
    "markersize": 9,
    "color": INK,
}


def run_figure(
    traces: Sequence[Trace], arm: ArmSpec, path: str | Path, title: str | None = None
) -> Path:
    """Draw the actual and desired path of the followed module's end, and the error.

    The figure shows each coordinate and the error [cm] over time, and the path from
    above. Colors are those of figure 6 of the paper. A band, and a tube in the view,
    show twice the predictive standard deviation around the predicted path.

    Args:
        traces: runs of the same task, base frame.
        arm: the arm that ran them.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.
        title: of the runs; by default the arm's name.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: there is no trace, a trace is of another arm, or the file cannot be
            written.
    """
    check_same_arm(traces, arm)
    figure = new_figure(11.0, 6.6)
    grid = figure.add_gridspec(4, 2, width_ratios=(1.25, 1.0))
    colors = colors_by_label(trace.label for trace in traces)
    labels = ["x [m]", "y [m]", "z [m]", "error [cm]"]
    *coordinates, error = charts.new_time_axes(figure, grid, labels)
    place = grid[:, 1]
    above, view = charts.titled_view(figure, place, Mounting.of(arm), ABOVE)
    for axis, axes in enumerate(coordinates):
        charts.draw_coordinate(axes, traces, axis)
    charts.draw_errors(error, traces, colors)
    predicted = next((trace for trace in traces if trace.has_band), None)
    if predicted is not None:
        color = colors[predicted.label]
        predictions.draw_bands(coordinates, error, predicted, color)
        predictions.draw_tube(above, predicted, view, color)
    charts.draw_desired(above, traces[0].desired_path, view)
    charts.draw_lines(
        above, traces, colors, lambda trace: seen(trace.followed_path, view)
    )
    charts.draw_obstacles_of_run(above, traces[0], view)
    above.plot(0, 0, label="base", **CROSS)
    module = f"end of module {traces[0].followed_module + 1} of {arm.module_count}"
    headline(coordinates[0], f"{title or arm.name}: {module}")
    return save_figure(figure, path)


def recording_figure(states: States, arm: ArmSpec, path: str | Path) -> Path:
    """Draw the workspace of a recording, one color for each module (figure 3).

    Args:
        states: end positions [m] and end axes, shape (samples, modules, 6), base frame.
            The figure shows at most 60 000 of them, evenly chosen.
        arm: the recorded arm; its mounting decides which way is up.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: the shape is wrong, or the file cannot be written.
    """
    states = np.asarray(states, dtype=float)
    if states.ndim != 3 or states.shape[-1] != 6 or not states.size:
        raise S2C2AError(
            f"states have shape {states.shape}, expected (samples, modules, 6) with at "
            "least one of each"
        )
    shown = states[:: -(-len(states) // MAX_SAMPLES)]
    figure = new_figure(11.0, 5.6)
    title = f"from the side, samples: {len(states):,}"
    for axes, nearest in charts.side_and_above(figure, arm, title):
        # draw all module ends; inner modules lie in front, for their clouds are small
        count = shown.shape[1]
        for module, color in enumerate(module_colors(count)):
            order = 2 + count - module
            label = f"module {module + 1}"
            style = {"color": color, "zorder": order, "label": label, **CLOUD}
            axes.plot(*seen(shown[:, module], nearest), **style)
        axes.plot(0, 0, zorder=3 + count, **CROSS)
    return save_figure(figure, path, markerscale=7)


def learning_curves(
    curves: Mapping[str, Float[np.ndarray, "epochs 3"]], path: str | Path
) -> Path:
    """Draw training losses (thin, dashed) and validation losses (solid) over epochs.

    A dot marks the lowest validation loss.

    Args:
        curves: for each network its rows of epoch, training loss, validation loss.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: there is no curve, one has no row, or the file cannot be written.
    """
    if not curves or not all(map(len, curves.values())):
        raise S2C2AError("a learning curve has no rows; train for at least one epoch")
    figure = new_figure(7.6, 4.6)
    axes = new_axes(figure, 111, "epoch", "loss")
    for name, color in colors_by_label(curves).items():
        epochs, train, validation = curves[name].T
        dashes = (0, (4, 2))
        axes.plot(epochs, train, color=color, lw=1.0, linestyle=dashes, alpha=0.8)
        best = int(np.argmin(validation))
        label = f"{name}   lowest {validation[best]:.3g}"
        axes.plot(epochs, validation, color=color, linewidth=1.7, label=label)
        axes.plot(epochs[best], validation[best], "o", color=color, markersize=4.5)
    if all((curve[:, 1:] > 0).all() for curve in curves.values()):
        axes.set_yscale("log")
    headline(axes, "validation (solid) and training (dashed)")
    return save_figure(figure, path)
