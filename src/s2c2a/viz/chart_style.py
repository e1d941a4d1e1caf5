"""How charts look: one place for type, lines and frames."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.layout_engine import ConstrainedLayoutEngine

from s2c2a.viz.colours import FAINT, INK, MUTED

LEAST_SPAN = 0.02  # m; a motion smaller than this is not blown up to fill its axes
HANDLE_WIDTH, LETTER_WIDTH = 0.6, 0.066  # inches, in a legend


def new_figure(width: float, height: float) -> Figure:
    """A white figure, width and height in inches, that lays its axes out by itself."""
    layout = ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.06, wspace=0.03, hspace=0.03)
    return Figure(figsize=(width, height), layout=layout, facecolor="white")


def new_axes(figure: Figure, place: SubplotSpec, x_label: str, y_label: str, **options) -> Axes:
    """Axes with a light grid and no box."""
    axes = figure.add_subplot(place, **options)
    axes.set_xlabel(x_label, color=INK, fontsize=9)
    axes.set_ylabel(y_label, color=INK, fontsize=9)
    axes.tick_params(colors=MUTED, labelsize=8, length=3)
    axes.grid(color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    for side in axes.spines:
        axes.spines[side].set(visible=side in ("left", "bottom"), color="#b9c1cb")
    return axes


def new_time_axes(figure: Figure, places: Sequence[SubplotSpec], y_labels: Sequence[str]) -> list[Axes]:
    """Axes over one time axis [s], from top to bottom; only the last ones number it."""
    axes = [new_axes(figure, places[0], "", y_labels[0])]
    axes += [
        new_axes(figure, place, "", label, sharex=axes[0])
        for place, label in zip(places[1:], y_labels[1:], strict=True)
    ]
    for one in axes[:-1]:
        one.tick_params(labelbottom=False)
    axes[-1].set_xlabel("time [s]", color=INK, fontsize=9)
    axes[-1].margins(x=0.01)
    figure.align_ylabels(axes)
    return axes


def padded_limits(values: np.ndarray, least_span: float = LEAST_SPAN) -> tuple[float, float]:
    """Limits with some room around all finite values, never closer together than the least span."""
    finite = values[np.isfinite(values)]
    low, high = (finite.min(), finite.max()) if finite.size else (0.0, 0.0)
    middle, half = (low + high) / 2, max(high - low, least_span) / 2
    return float(middle - 1.12 * half), float(middle + 1.12 * half)


def draw_arrow(axes: Axes, start, end, colour: str, width: float, head: float) -> None:
    """A straight arrow, or a line where its head has no size [points]."""
    look = {"arrowstyle": "-|>" if head else "-", "shrinkA": 0, "shrinkB": 0, "mutation_scale": head or 1}
    axes.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops={"color": colour, "lw": width, **look}, zorder=3)


def say_nothing_here(axes: Axes, text: str) -> None:
    """Words in the middle of axes that have nothing to show."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=MUTED, fontsize=9)


def headline(axes: Axes, text: str) -> None:
    """A small bold title at the left edge; a name from a user is shown as it is, not read as mathematics."""
    axes.set_title(text, loc="left", fontsize=9.5, fontweight="bold", color=INK, parse_math=False)


def legend(owner: Axes | Figure, axes: Axes, **options) -> None:
    """A legend without a frame that names what is drawn in `axes`, if anything has a name."""
    _write_legend(owner, *axes.get_legend_handles_labels(), **options)


def legend_above(figure: Figure) -> None:
    """One legend above all panels, in as many columns as fit; what several panels name comes once."""
    pairs = [pair for axes in figure.axes for pair in zip(*axes.get_legend_handles_labels(), strict=True)]
    handles = {label: handle for handle, label in reversed(pairs)}
    labels = list(dict.fromkeys(label for _, label in pairs))
    columns = _columns_that_fit(labels, figure.get_figwidth())
    _write_legend(figure, [handles[label] for label in labels], labels, loc="outside upper right", ncols=columns)


def _columns_that_fit(labels: list[str], width: float) -> int:
    """Most columns of legend that are no wider together than `width` [inches]."""
    for count in range(len(labels), 1, -1):
        columns = np.array_split(labels, count)
        if sum(HANDLE_WIDTH + LETTER_WIDTH * max(map(len, column)) for column in columns) < width:
            return count
    return 1


def _write_legend(owner: Axes | Figure, handles: list, labels: list[str], **options) -> None:
    if handles:
        shown = owner.legend(handles, labels, frameon=False, fontsize=8.5, labelcolor=INK, **options)
        for text in shown.get_texts():
            text.set_parse_math(False)
