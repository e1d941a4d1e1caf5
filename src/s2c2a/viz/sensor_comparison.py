"""Figure of what sensors are worth: for every set of them a line, with a dot for every load."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.ticker import NullFormatter, ScalarFormatter

from s2c2a.viz.charts import headline, legend, new_axes, new_figure, save_figure
from s2c2a.viz.colors import FAINT, colors_by_label

TICKS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50)


def worth_figure(
    errors: Mapping[str, Mapping[str, float]], path: str | Path, title: str
) -> Path:
    """Draw errors of the tip, best set last, so that it stands on top.

    Args:
        errors: set of sensors -> what hangs at the tip, in words -> error [cm].
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.
        title: above it.

    Raises:
        S2C2AError: the file cannot be written.
    """
    figure = new_figure(7.6, 1.4 + 0.34 * len(errors))
    axes = new_axes(
        figure, figure.add_gridspec(1, 1)[0], "mean error of the tip [cm]", ""
    )
    loads = list(dict.fromkeys(load for each in errors.values() for load in each))
    names = sorted(
        errors, key=lambda name: -float(np.mean(np.log(list(errors[name].values()))))
    )
    for place, name in enumerate(names):
        axes.plot(
            [min(errors[name].values()), max(errors[name].values())],
            [place] * 2,
            color=FAINT,
            linewidth=5,
        )
    for load, color in colors_by_label(loads).items():
        places = [place for place, name in enumerate(names) if load in errors[name]]
        axes.plot(
            [errors[names[place]][load] for place in places],
            places,
            "o",
            color=color,
            label=load,
        )
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_formatter(NullFormatter())
    low, high = axes.get_xlim()
    axes.set_xticks([tick for tick in TICKS if low <= tick <= high])
    axes.set_yticks(range(len(names)), names)
    headline(axes, title)
    legend(figure)
    return save_figure(figure, path)
