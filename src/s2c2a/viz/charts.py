"""Common parts of figures: axes, legends, lines over time, views in space, saving."""

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec, SubplotSpec
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Circle, Polygon
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.files.text import write_atomically
from s2c2a.obstacles import THRESHOLD, is_half_space, is_sphere
from s2c2a.viz.arrays import Obstacles, Points
from s2c2a.viz.colors import (
    DESIRED,
    FAINT,
    GRID_STRONG,
    INK,
    MUTED,
    OBSTACLE,
    UNCOUNTED,
    colors_by_label,
)
from s2c2a.viz.mounting import ABOVE, SIDE, Mounting, View
from s2c2a.viz.solids import outline, surface
from s2c2a.viz.trace import Trace

FIGURE_FORMATS = ("png", "pdf", "svg")
DOTS_PER_INCH = 160  # sharp on the screens of the docs, at a tenth of a megabyte
FRONT = 50  # zorder of the first trace; the others lie behind it
DESIRED_LINE: dict[str, Any] = {"color": DESIRED, "linewidth": 2.6, "alpha": 0.75}
MIN_SPAN = 0.02  # m; smallest range of an axis: millimeters remain small in it
COLUMNS = 3
"""Of panels: each is then 9 cm wide on an A4 page in landscape."""
LETTERS_PER_INCH = 13.5
"""In a line of text of 8.5 points, measured on the package's figures."""

Colors = Mapping[str, str]
"""Label of a trace -> its color."""


def new_figure(width: float, height: float) -> Figure:
    """White figure with automatic layout; width and height in inches."""
    layout = ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.06, wspace=0.03, hspace=0.03)
    return Figure(figsize=(width, height), layout=layout, facecolor="white")


def new_axes(
    figure: Figure, place: SubplotSpec | int, x_label: str, y_label: str, **options
) -> Axes:
    """Axes with a light grid and without a box; place 111 is the whole figure."""
    axes = figure.add_subplot(place, **options)
    axes.set_xlabel(x_label, color=INK, fontsize=9)
    axes.set_ylabel(y_label, color=INK, fontsize=9)
    axes.tick_params(colors=MUTED, labelsize=8, length=3)
    axes.grid(color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    for side in axes.spines:
        axes.spines[side].set(visible=side in ("left", "bottom"), color=GRID_STRONG)
    return axes


def new_time_axes(
    figure: Figure, grid: GridSpec, y_labels: Sequence[str]
) -> list[Axes]:
    """Axes in a grid's first column that share one time axis [s], from the top."""
    axes: list[Axes] = []
    for row, label in enumerate(y_labels):
        shared = axes[0] if axes else None
        panel = new_axes(figure, grid[row, 0], "time [s]", label, sharex=shared)
        panel.label_outer()
        axes.append(panel)
    axes[-1].margins(x=0.01)
    figure.align_ylabels(axes)
    return axes


def label_log_axis(axes: Axes) -> None:
    """Make x logarithmic and label it at 1, 2 and 5 times powers of ten."""
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))


def draw_arrow(axes: Axes, start, end, color: str, width: float, head: float) -> None:
    """Draw a straight arrow, or a line if the size of its head [points] is zero."""
    style = {
        "color": color,
        "lw": width,
        "arrowstyle": "-|>" if head else "-",
        "shrinkA": 0,
        "shrinkB": 0,
        "mutation_scale": head or 1,
    }
    axes.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=style, zorder=3)


def note(axes: Axes, x: float, y: float, text: str, **style) -> None:
    """Write a small text at shares of the width and the height of axes."""
    look: dict[str, Any] = {"color": MUTED, "fontsize": 8, **style}
    axes.text(x, y, text, transform=axes.transAxes, **look)


def write_placeholder(axes: Axes, text: str) -> None:
    """Write a text in the middle of empty axes."""
    note(axes, 0.5, 0.5, text, ha="center", va="center", fontsize=9)


def headline(axes: Axes, text: str) -> None:
    """Set a small bold title at the left; `$` has no special meaning in it."""
    axes.set_title(
        text, loc="left", fontsize=9.5, fontweight="bold", color=INK, parse_math=False
    )


def legend(figure: Figure, **options) -> None:
    """Add one frameless legend above all axes, with each label once, if there is none.

    It has as many columns as fit into the figure.
    """
    handles: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if not handles or figure.legends:
        return
    style = {
        "frameon": False,
        "fontsize": 8.5,
        "labelcolor": INK,
        "loc": "outside upper right",
        **options,
    }
    for columns in range(len(handles), 0, -1):
        shown = figure.legend(
            list(handles.values()), list(handles), ncols=columns, **style
        )
        for text in shown.get_texts():
            text.set_parse_math(False)
        if columns == 1 or shown.get_window_extent().width < figure.bbox.width:
            return
        shown.remove()


def seen(points: Float[np.ndarray, "*batch features"], view: View) -> tuple[Any, Any]:
    """Coordinates of points to the right and upward in a view."""
    return points[..., view[0]], points[..., view[1]]


def draw_desired(axes: Axes, path: Points, view: View) -> None:
    """Draw a desired path, with a disc if it stays in place; NaN is left out."""
    finite = path[np.isfinite(path).all(axis=-1)]
    if not len(finite):
        return
    stationary = np.allclose(finite, finite[0])
    marker = "o" if stationary else ""
    style = {"label": "desired", "marker": marker, "markersize": 9, **DESIRED_LINE}
    axes.plot(*seen(path, view), **style)


def draw_obstacles(axes: Axes, obstacles: Obstacles, view: View, **style) -> None:
    """Draw the outlines of obstacles (`Trace.standing`)."""
    look: dict[str, Any] = {
        "facecolor": OBSTACLE + "33",
        "edgecolor": OBSTACLE,
        "linewidth": 1,
    }
    shown = max(map(np.ptp, (axes.get_xlim(), axes.get_ylim()))) / 2.0
    for row in obstacles:
        if is_sphere(row):
            circle = Circle(seen(row, view), row[THRESHOLD], **(look | style))
            axes.add_patch(circle)
            continue
        # a wall may cover the whole picture
        behind = (
            {"facecolor": OBSTACLE + "18", "zorder": 0.5} if is_half_space(row) else {}
        )
        corners = outline(surface(row, shown)[:, view])
        axes.add_patch(Polygon(corners, **(look | style | behind)))


def draw_obstacles_of_run(axes: Axes, trace: Trace, view: View) -> None:
    """Draw every obstacle of a run with the time when it appears or has moved."""
    before = ""
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
    style: dict[str, Any] = {"color": INK, "fontsize": 9, "clip_on": True, "bbox": box}
    for row, note in trace.drawn_obstacles():
        draw_obstacles(axes, row[None], view, label="obstacle")
        if note != before:  # the spheres of a mesh have one note
            text = axes.text(*seen(row, view), note, ha="center", va="center", **style)
            text.set_zorder(FRONT + 1)
        before = note


def titled_view(
    figure: Figure, place: SubplotSpec, mounting: Mounting, view: View, title: str = ""
) -> tuple[Axes, View]:
    """Axes [m] of a view of the world, with equal scales, and the base's axes in it.

    From above, they run to the right and upward as on paper; what that would mirror is
    seen from below. From the side, gravity acts downward, and axes that run backward are
    named.
    """
    nearest, backward = mounting.flat(view)
    if view == ABOVE:
        title = "from below" if backward[0] != backward[1] else "from above"
        backward = (False, False)
    right, up = ("xyz"[axis] for axis in nearest)
    axes = new_axes(figure, place, f"{right} [m]", f"{up} [m]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.locator_params(nbins=6, steps=[1, 2, 5, 10])
    axes.xaxis.set_inverted(backward[0])
    axes.yaxis.set_inverted(backward[1])
    directions = ("to the left", "downward")
    notes = [
        f"{'xyz'[axis]} runs {direction}"
        for axis, direction, runs in zip(nearest, directions, backward, strict=True)
        if runs
    ]
    headline(axes, f"{title}; {', '.join(notes)}" if notes else title)
    return axes, nearest


def side_and_above(
    figure: Figure, arm: ArmSpec, title: str
) -> Iterator[tuple[Axes, View]]:
    """`titled_view` from the side, with a title, and beside it from above or below."""
    grid = figure.add_gridspec(1, 2)
    mounting = Mounting.of(arm)
    yield titled_view(figure, grid[0], mounting, SIDE, title)
    yield titled_view(figure, grid[1], mounting, ABOVE)


def named_error(trace: Trace) -> str:
    """Label of a trace with mean and standard deviation of its finite, counted errors."""
    errors = 100 * trace.counted_errors
    finite = errors[np.isfinite(errors)]
    if not finite.size:
        return trace.label
    return f"{trace.label}   {finite.mean():.2f} ± {finite.std():.2f} cm"


def draw_lines(
    axes: Axes, traces: Sequence[Trace], colors: Colors, shown: Callable
) -> None:
    """Draw a line for each trace, labeled with its error; the first in front.

    Args:
        axes: axes to draw in.
        traces: runs of the same task.
        colors: color of each label.
        shown: maps a trace to the x and y of its line.
    """
    for rank, trace in enumerate(traces):
        style: dict[str, Any] = {
            "color": colors[trace.label],
            "linewidth": 1.4,
            "zorder": FRONT - rank,
        }
        axes.plot(*shown(trace), label=named_error(trace), **style)


def draw_coordinate(axes: Axes, traces: Sequence[Trace], axis: int) -> None:
    """Draw one coordinate of the followed end over time, above its desired value."""
    desired = traces[0].desired_path[:, axis]
    label = "desired" if np.isfinite(desired).any() else None
    axes.plot(traces[0].times, desired, label=label, **DESIRED_LINE)
    colors = colors_by_label(trace.label for trace in traces)
    draw_lines(
        axes, traces, colors, lambda one: (one.times, one.followed_path[:, axis])
    )
    followed = (trace.followed_path[:, axis] for trace in traces)
    # limits around all finite values, at least `MIN_SPAN` apart
    values = np.concatenate([desired, *followed])
    finite = values[np.isfinite(values)]
    low, high = (finite.min(), finite.max()) if finite.size else (0.0, 0.0)
    middle = (low + high) / 2
    half = 1.12 * max(high - low, MIN_SPAN) / 2
    axes.set_ylim(middle - half, middle + half)


def draw_errors(axes: Axes, traces: Sequence[Trace], colors: Colors) -> None:
    """Draw position errors [cm] over time and shade the uncounted steps."""
    draw_lines(axes, traces, colors, lambda one: (one.times, 100 * one.position_errors))
    axes.set_ylim(bottom=0)
    for start, end in traces[0].uncounted_spans:
        axes.axvspan(start, end, color=UNCOUNTED, linewidth=0, label="not counted")
    if not any(np.isfinite(trace.position_errors).any() for trace in traces):
        write_placeholder(axes, "no desired position")


def save_figure(figure: Figure, path: str | Path, **options) -> Path:
    """Write a figure and its legend in the format that the file name ends in.

    Args:
        figure: the figure.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.
        options: of the legend.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: the name has another ending, or the file cannot be written.
    """
    ending = figure_format(path)
    legend(figure, **options)
    content = io.BytesIO()
    figure.savefig(content, format=ending, dpi=DOTS_PER_INCH)
    return write_atomically(content.getvalue(), path)


def figure_format(path: str | Path) -> str:
    """The format of a figure, such as "png", by the ending of its file.

    Raises:
        S2C2AError: it is none of `FIGURE_FORMATS`.
    """
    ending = Path(path).suffix.lower().removeprefix(".")
    if ending not in FIGURE_FORMATS:
        formats = ", .".join(FIGURE_FORMATS)
        raise S2C2AError(
            f"{path}: the name of a figure ends in .{formats}, not in '.{ending}'"
        )
    return ending
