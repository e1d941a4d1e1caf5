"""Figure that compares sets of sensors: a row for each set, a dot for each payload."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from s2c2a.viz.charts import (
    headline,
    label_log_axis,
    new_axes,
    new_figure,
    save_figure,
)
from s2c2a.viz.colors import FAINT, colors_by_label


def sensor_comparison_figure(
    errors: Mapping[str, Mapping[str, float]], path: str | Path, title: str
) -> Path:
    """Draw mean errors of the tip, the best set of sensors in the top row.

    Args:
        errors: set of sensors -> description of the payload -> error [cm].
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.
        title: above the axes.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: the file cannot be written.
    """
    figure = new_figure(7.6, 1.4 + 0.34 * len(errors))
    axes = new_axes(figure, 111, "mean error of the tip [cm]", "")
    mean_logs = {
        name: float(np.mean(np.log(list(values.values()))))
        for name, values in errors.items()
    }
    names = sorted(errors, key=lambda name: -mean_logs[name])
    payloads: dict[str, None] = {}  # in order of first appearance
    for name, values in errors.items():
        payloads |= dict.fromkeys(values)
        span = [min(values.values()), max(values.values())]
        axes.plot(span, [names.index(name)] * 2, color=FAINT, linewidth=5)
    for payload, color in colors_by_label(payloads).items():
        rows = [row for row, name in enumerate(names) if payload in errors[name]]
        means = [errors[names[row]][payload] for row in rows]
        axes.plot(means, rows, "o", color=color, label=payload)
    label_log_axis(axes)
    axes.set_yticks(range(len(names)), names)
    headline(axes, title)
    return save_figure(figure, path)
