"""A search for a recipe as a figure: how it came along, and what it tried."""

import os
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, NullFormatter

from s2c2a.errors import S2C2AError
from s2c2a.viz.chart_style import headline, new_axes, new_figure
from s2c2a.viz.colours import INK, MUTED, WANTED
from s2c2a.viz.saving import save_figure

COLUMNS = 3
DOT: dict[str, Any] = {"marker": "o", "linestyle": "none", "markersize": 4.5, "alpha": 0.75, "markeredgewidth": 0}


def trials_figure(
    numbers: Sequence[int],
    scores: Float[np.ndarray, " trials"],
    values: Mapping[str, Float[np.ndarray, " trials"]],
    label: str,
    logarithmic: Collection[str],
    path: str | os.PathLike,
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
        raise S2C2AError("there is no finished trial to draw; let at least one come to its end")
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
        axes = new_axes(figure, grid[1 + place // COLUMNS, place % COLUMNS], name, label)
        if name in logarithmic:
            axes.set_xscale("log")
            axes.xaxis.set_minor_formatter(NullFormatter())
        _dots(axes, tried, scores, best)
        headline(axes, f"best at {tried[best]:.4g}")
    return save_figure(figure, path)


def _dots(axes: Axes, places: np.ndarray, scores: np.ndarray, best: int) -> None:
    axes.plot(places, scores, color=INK, **DOT)
    axes.plot(places[best], scores[best], "o", color=WANTED, markersize=7)
    if scores.min() > 0 and scores.max() > 20 * scores.min():
        axes.set_yscale("log")
