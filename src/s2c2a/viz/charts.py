"""How charts look: type, lines and frames; runs over time, or seen along an axis of the base frame; files of them."""

import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec, SubplotSpec
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Circle

from s2c2a.errors import S2C2AError
from s2c2a.files import save_whole
from s2c2a.viz.colors import FAINT, INK, MUTED, DESIRED, colors_by_label
from s2c2a.viz.mounting import ABOVE, SIDE, View
from s2c2a.viz.trace import Trace

FIGURE_FORMATS = ("png", "pdf", "svg")
DOTS_PER_INCH = 160
NAMES = {ABOVE: "from above", SIDE: "from the side"}
FRONT = 50  # drawing order of the first trace, the one in front
DESIRED_LINE: dict[str, Any] = {"color": DESIRED, "linewidth": 2.6, "alpha": 0.75}
OBSTACLE = "#6b6f86"
NOT_COUNTED = "#e6eaf0"
STANDING = 1e-6  # m; a target that moves less stands still
MIN_SPAN = 0.02  # m; a motion smaller than this is not blown up to fill its axes
# inches, in a legend
HANDLE_WIDTH = 0.6
LETTER_WIDTH = 0.066

Series = Float[np.ndarray, " time"]
Colors = Mapping[str, str]
"""Label of a trace -> its color."""


def new_figure(width: float, height: float) -> Figure:
    """A white figure, width and height in inches, that lays its axes out by itself."""
    layout = ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.06, wspace=0.03, hspace=0.03)
    return Figure(figsize=(width, height), layout=layout, facecolor="white")


def new_axes(
    figure: Figure, place: SubplotSpec, x_label: str, y_label: str, **options
) -> Axes:
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


def new_time_axes(
    figure: Figure, grid: GridSpec, y_labels: Sequence[str]
) -> list[Axes]:
    """Axes over one time axis [s], from top to bottom in a grid's first column; only the last ones number it."""
    axes: list[Axes] = []
    for row, label in enumerate(y_labels):
        axes.append(
            new_axes(
                figure,
                grid[row, 0],
                "time [s]",
                label,
                sharex=axes[0] if axes else None,
            )
        )
        axes[-1].label_outer()
    axes[-1].margins(x=0.01)
    figure.align_ylabels(axes)
    return axes


def view_axes(
    figure: Figure,
    place: SubplotSpec,
    view: View,
    backward: tuple[bool, bool] = (False, False),
) -> Axes:
    """Axes in meters, at equal scale in both directions; what runs backward grows to the left or downward."""
    right, up = ("xyz"[coordinate] for coordinate in view)
    axes = new_axes(figure, place, f"{right} [m]", f"{up} [m]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.locator_params(nbins=6, steps=[1, 2, 5, 10])
    axes.xaxis.set_inverted(backward[0])
    axes.yaxis.set_inverted(backward[1])
    return axes


def padded_limits(
    values: np.ndarray, min_span: float = MIN_SPAN
) -> tuple[float, float]:
    """Limits with some room around all finite values, never closer together than the least span."""
    finite = values[np.isfinite(values)]
    low, high = (finite.min(), finite.max()) if finite.size else (0.0, 0.0)
    middle = (low + high) / 2
    half = max(high - low, min_span) / 2
    return float(middle - 1.12 * half), float(middle + 1.12 * half)


def draw_arrow(axes: Axes, start, end, color: str, width: float, head: float) -> None:
    """A straight arrow, or a line where its head has no size [points]."""
    look = {
        "arrowstyle": "-|>" if head else "-",
        "shrinkA": 0,
        "shrinkB": 0,
        "mutation_scale": head or 1,
    }
    axes.annotate(
        "",
        xy=tuple(end),
        xytext=tuple(start),
        arrowprops={"color": color, "lw": width, **look},
        zorder=3,
    )


def say_nothing_here(axes: Axes, text: str) -> None:
    """Words in the middle of axes that have nothing to show."""
    axes.text(
        0.5,
        0.5,
        text,
        transform=axes.transAxes,
        ha="center",
        va="center",
        color=MUTED,
        fontsize=9,
    )


def headline(axes: Axes, text: str) -> None:
    """A small bold title at the left edge; a name from a user is shown as it is, not read as mathematics."""
    axes.set_title(
        text, loc="left", fontsize=9.5, fontweight="bold", color=INK, parse_math=False
    )


def legend(figure: Figure, **options) -> None:
    """One legend above all panels, without a frame; what several panels name comes once."""
    pairs = [
        pair
        for axes in figure.axes
        for pair in zip(*axes.get_legend_handles_labels(), strict=True)
    ]
    handles = {label: handle for handle, label in reversed(pairs)}
    labels = list(dict.fromkeys(label for _, label in pairs))
    if labels:
        look = {
            "frameon": False,
            "fontsize": 8.5,
            "labelcolor": INK,
            "loc": "outside upper right",
            **options,
        }
        columns = _columns_that_fit(labels, figure.get_figwidth())
        shown = figure.legend(
            [handles[label] for label in labels], labels, ncols=columns, **look
        )
        for text in shown.get_texts():
            text.set_parse_math(False)


def _columns_that_fit(labels: list[str], width: float) -> int:
    """Most columns of legend that are no wider together than `width` [inches]."""
    for count in range(len(labels), 1, -1):
        columns = np.array_split(labels, count)
        if (
            sum(
                HANDLE_WIDTH + LETTER_WIDTH * max(map(len, column))
                for column in columns
            )
            < width
        ):
            return count
    return 1


def seen(points: Float[np.ndarray, "*batch features"], view: View) -> tuple[Any, Any]:
    """The coordinates that run to the right and upward."""
    return points[..., view[0]], points[..., view[1]]


def draw_desired(axes: Axes, path: Float[np.ndarray, "time 3"], view: View) -> None:
    """A line for a path, a disc for a place, nothing where nothing is asked."""
    finite = path[np.isfinite(path).all(axis=-1)]
    if len(finite):
        stands = np.ptp(finite, axis=0).max() < STANDING
        axes.plot(
            *seen(path, view),
            label="desired",
            marker="o" if stands else "",
            markersize=9,
            **DESIRED_LINE,
        )


def draw_obstacles(
    axes: Axes, spheres: Float[np.ndarray, "spheres 4"], view: View, **style
) -> None:
    """Discs as large as the thresholds of obstacles, as `Trace.spheres` says them."""
    look = {
        "facecolor": OBSTACLE + "33",
        "edgecolor": OBSTACLE,
        "linewidth": 1,
        **style,
    }
    for sphere in spheres:
        axes.add_patch(Circle(seen(sphere, view), sphere[3], **look))


def draw_ends(
    axes: Axes,
    path: Float[np.ndarray, "time 3"],
    view: View,
    color: str,
    order: float = FRONT,
) -> None:
    """A hollow disc where a path begins, a full one where it ends."""
    places = path[np.isfinite(path).all(axis=-1)]
    for place, fill in zip(
        places[[0, -1]] if len(places) else (), ("white", color), strict=False
    ):
        axes.plot(
            *seen(place, view),
            "o",
            markersize=5.5,
            color=color,
            markerfacecolor=fill,
            zorder=order + 1,
        )


def draw_run(
    axes: Axes, trace: Trace, colors: Colors, view: View, order: float = FRONT
) -> None:
    """Path of the followed end, with its start and end."""
    path = trace.followed_path
    color = colors[trace.label]
    axes.plot(
        *seen(path, view), color=color, linewidth=1.5, zorder=order, label=trace.label
    )
    draw_ends(axes, path, view, color, order)


def name_ends(axes: Axes) -> None:
    """What the discs of `draw_ends` mean, for the legend."""
    for name, fill in (("start", "white"), ("end", MUTED)):
        axes.plot(
            [],
            [],
            "o",
            markersize=5.5,
            color=MUTED,
            markerfacecolor=fill,
            linestyle="none",
            label=name,
        )


def draw_ring(
    axes: Axes, place: Float[np.ndarray, "3"], view: View, size: float, label: str
) -> None:
    """A ring round where an end should be, as wide as so many points."""
    look: dict[str, Any] = {
        "markersize": size,
        "markerfacecolor": DESIRED + "38",
        "markeredgecolor": DESIRED,
    }
    axes.plot(*seen(place, view), "o", linestyle="none", label=label, **look)


def named(label: str, errors: np.ndarray, unit: str, digits: int) -> str:
    """A label with mean and standard deviation of what errors are known."""
    known = errors[np.isfinite(errors)]
    return (
        f"{label}   {known.mean():.{digits}f} ± {known.std():.{digits}f}{unit}"
        if known.size
        else label
    )


def named_error(trace: Trace) -> str:
    """A trace's label with the error over the steps that count."""
    return named(trace.label, 100 * trace.counted_errors, " cm", 2)


def draw_lines(
    axes: Axes,
    traces: Sequence[Trace],
    colors: Colors,
    shown: Callable,
    name=named_error,
) -> None:
    """A line for each trace, the first in front; `shown` says its x and y, `name` its label."""
    for place, trace in enumerate(traces):
        look: dict[str, Any] = {
            "color": colors[trace.label],
            "linewidth": 1.4,
            "zorder": FRONT - place,
        }
        axes.plot(*shown(trace), label=name(trace), **look)


def draw_over_time(
    axes: Axes,
    traces: Sequence[Trace],
    desired: Series,
    values: Callable,
    name=named_error,
    min_span=MIN_SPAN,
) -> None:
    """What each trace did over time, its `values`, and below it what was desired of the first; all of it in sight."""
    axes.plot(
        traces[0].times,
        desired,
        label="desired" if np.isfinite(desired).any() else None,
        **DESIRED_LINE,
    )
    colors = colors_by_label(trace.label for trace in traces)
    draw_lines(axes, traces, colors, lambda trace: (trace.times, values(trace)), name)
    axes.set_ylim(
        *padded_limits(np.concatenate([desired, *map(values, traces)]), min_span)
    )


def draw_errors(
    axes: Axes, traces: Sequence[Trace], colors: Colors, name=named_error
) -> None:
    """Distance from what is desired [cm] over time; steps that do not count in its mean are shaded."""
    draw_lines(
        axes,
        traces,
        colors,
        lambda trace: (trace.times, 100 * trace.position_errors),
        name,
    )
    axes.set_ylim(bottom=0)
    for start, end in traces[0].uncounted_spans:
        axes.axvspan(start, end, color=NOT_COUNTED, linewidth=0, label="not counted")
    if not any(np.isfinite(trace.position_errors).any() for trace in traces):
        say_nothing_here(axes, "no position is asked for")


def save_figure(figure: Figure, path: str | Path, **options) -> Path:
    """Write a figure, with its legend, in the format that the file's name ends in: png, pdf or svg.

    Raises:
        S2C2AError: the name ends in something else, or the file cannot be written.
    """
    ending = Path(path).suffix.lower().removeprefix(".")
    if ending not in FIGURE_FORMATS:
        raise S2C2AError(
            f"{path}: a figure's name ends in .{', .'.join(FIGURE_FORMATS)}, not in '.{ending}'"
        )
    legend(figure, **options)
    content = io.BytesIO()
    figure.savefig(content, format=ending, dpi=DOTS_PER_INCH)
    return save_whole(content.getvalue(), path)
