"""Figure of the trials of a sweep."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, NullFormatter

from s2c2a.errors import S2C2AError
from s2c2a.viz.charts import headline, new_axes, new_figure, save_figure
from s2c2a.viz.colors import DESIRED, INK, MUTED
from s2c2a.viz.figures import DOT

COLUMNS = 3  # axes in a row of parameters


def trials_figure(
    numbers: Sequence[int],
    scores: Float[np.ndarray, " trials"],
    values: Mapping[str, Float[np.ndarray, " trials"]],
    label: str,
    logarithmic: Collection[str],
    path: str | Path,
    rises: bool = False,
) -> Path:
    """Draw the scores of a sweep over trials and over each parameter.

    A step line shows the best score so far, a red dot the best trial.

    Args:
        numbers: of the successful trials.
        scores: of these trials.
        values: name of each parameter -> its value in these trials.
        label: of the scores, with their unit.
        logarithmic: names of the parameters with a logarithmic axis.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.
        rises: whether larger scores are better.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: there is no trial, or the file cannot be written.
    """
    if not len(numbers):
        raise S2C2AError("there is no finished trial to draw; finish at least one")
    rows = 1 + -(-len(values) // COLUMNS)
    figure = new_figure(11.0, 3.0 * rows)
    grid = figure.add_gridspec(rows, COLUMNS)
    best = int(np.argmax(scores) if rises else np.argmin(scores))
    history = new_axes(figure, grid[0, :], "trial", label)
    accumulate = np.maximum.accumulate if rises else np.minimum.accumulate
    best_so_far = accumulate(scores)
    history.step(numbers, best_so_far, where="post", color=MUTED, linewidth=1.2)
    history.xaxis.set_major_locator(MaxNLocator(integer=True))
    _draw_scores(history, np.asarray(numbers, float), scores, best)
    headline(history, f"best: {scores[best]:.3g} in trial {numbers[best]}")
    for place, (name, parameter) in enumerate(values.items()):
        row, column = divmod(place, COLUMNS)
        axes = new_axes(figure, grid[1 + row, column], name, label)
        if name in logarithmic:
            axes.set_xscale("log")
            axes.xaxis.set_minor_formatter(NullFormatter())
        _draw_scores(axes, parameter, scores, best)
        headline(axes, f"best at {parameter[best]:.4g}")
    return save_figure(figure, path)


def _draw_scores(axes: Axes, x: np.ndarray, scores: np.ndarray, best: int) -> None:
    axes.plot(x, scores, color=INK, **DOT)
    axes.plot(x[best], scores[best], "o", color=DESIRED, markersize=7)
    if scores.min() > 0 and scores.max() > 20 * scores.min():
        axes.set_yscale("log")
