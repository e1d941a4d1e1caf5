"""How times grow with the size of things, over logarithmic axes: a power law is a straight line."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from s2c2a.errors import S2C2AError
from s2c2a.viz.chart_style import headline, legend, new_axes, new_figure
from s2c2a.viz.colours import colours_by_label
from s2c2a.viz.saving import save_figure

PANELS_IN_A_ROW = 2


@dataclass(frozen=True)
class GrowthCurve:
    """Times of one thing at several sizes.

    Attributes:
        of: what grows; curves of the same thing share a panel.
        label: what is timed.
        sizes: above zero, rising, shape (sizes,).
        medians: [s], shape (sizes,).
        percentiles_99: [s], shape (sizes,).
        slope: exponent of the power law that fits.
    """

    of: str
    label: str
    sizes: Float[np.ndarray, " sizes"]
    medians: Float[np.ndarray, " sizes"]
    percentiles_99: Float[np.ndarray, " sizes"]
    slope: float


def growth_figure(curves: Sequence[GrowthCurve], path: str | os.PathLike) -> Path:
    """Draw medians as points, up to the 99th percentile as bars, and the power law that fits as a line.

    Args:
        curves: at least one.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: there is no curve, or the file cannot be written.
    """
    if not curves:
        raise S2C2AError("there is no growth to draw; measure the part 'growth' first")
    things = list(dict.fromkeys(curve.of for curve in curves))
    rows = -(-len(things) // PANELS_IN_A_ROW)
    figure = new_figure(11.0, 3.6 * rows)
    grid = figure.add_gridspec(rows, PANELS_IN_A_ROW)
    for number, thing in enumerate(things):
        axes = new_axes(figure, grid[divmod(number, PANELS_IN_A_ROW)], f"number of {thing}", "time [ms]")
        _draw(axes, [curve for curve in curves if curve.of == thing])
        headline(axes, thing)
        legend(axes, axes, loc="upper left")
    return save_figure(figure, path)


def _draw(axes: Axes, curves: Sequence[GrowthCurve]) -> None:
    colours = colours_by_label(curve.label for curve in curves)
    for curve in curves:
        colour, middle, top = colours[curve.label], 1e3 * curve.medians, 1e3 * curve.percentiles_99
        bars = np.stack([np.zeros_like(middle), np.maximum(top - middle, 0.0)])
        axes.errorbar(curve.sizes, middle, bars, fmt="o", color=colour, markersize=4.5, elinewidth=0.9, capsize=2)
        label = f"{curve.label}: exponent {curve.slope:.2f}"
        axes.plot(curve.sizes, _fitted(curve.sizes, middle, curve.slope), color=colour, linewidth=1.3, label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    sizes = sorted({float(size) for curve in curves for size in curve.sizes})
    axes.set_xticks(sizes)
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.margins(y=0.15)


def _fitted(sizes: np.ndarray, times: np.ndarray, slope: float) -> np.ndarray:
    """The power law of that exponent through the points' middle."""
    middle = np.log(times).mean() - slope * np.log(sizes).mean()
    return np.exp(middle) * sizes**slope
