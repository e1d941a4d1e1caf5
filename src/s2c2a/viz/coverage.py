"""Figure of the coverage of a recording: bends of neighboring modules, and speeds.

The workspace of the tip does not show whether the modules bent against each other
(`evaluation.coverage`).
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from jaxtyping import UInt8
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from s2c2a.episodes import Episode
from s2c2a.evaluation.coverage import HOLD, NEAR_BEND, NEAR_TIP, Coverage
from s2c2a.viz.charts import (
    COLUMNS,
    DOTS_PER_INCH,
    LETTERS_PER_INCH,
    headline,
    label_log_axis,
    new_axes,
    new_figure,
    note,
    save_figure,
    write_placeholder,
)
from s2c2a.viz.colors import DESIRED, INK, MUTED, REAL

PANEL = (3.7, 3.1)  # width and height of a panel, inches
TEXT_HEIGHT = 0.7  # inches; three lines
CELLS = 40  # across a panel, 2 mm each: finer ones look empty
SLOWEST_SHOWN = 0.6  # of the hold speed: the left edge of the bar of holds
LIMIT_LINE: dict[str, Any] = {
    "color": MUTED,
    "linewidth": 0.9,
    "linestyle": (0, (4, 3)),
}
EQUAL_LINE: dict[str, Any] = {"color": DESIRED, "linewidth": 1.2, "alpha": 0.8}


def coverage_figure(episodes: Sequence[Episode], path: str | Path) -> Path:
    """Draw which configurations and speeds a recording contains.

    For each pair of neighboring modules, a density shows the bend of the inner module
    along the direction of the outer one, and the bend of the outer one: equal bends lie
    on the diagonal, S shapes at the left. An arm of one module shows its bend plane.
    The last panel shows the speeds; texts state the shares that are reached.

    Args:
        episodes: of one arm; measured, simulated or imported, with or without states.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: the episodes lack a sensor that configurations need, or the file
            cannot be written.
    """
    return save_figure(_coverage(Coverage.of(episodes), COLUMNS), path)


def coverage_image(episodes: Sequence[Episode]) -> UInt8[np.ndarray, "height width 3"]:
    """`coverage_figure` as pixels, with all panels below each other.

    Raises:
        S2C2AError: the episodes lack a sensor that configurations need.
    """
    figure = _coverage(Coverage.of(episodes), 1)
    figure.dpi = DOTS_PER_INCH
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.array(canvas.buffer_rgba())[..., :3]


def _coverage(coverage: Coverage, columns: int) -> Figure:
    """All panels, in rows of some columns."""
    pairs = range(coverage.arm.module_count - 1)
    panels = [partial(_draw_pair, coverage, inner) for inner in pairs]
    if not panels:
        panels = [partial(_draw_bend_plane, coverage)]
    panels.append(partial(_draw_speeds, coverage))
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    width, height = PANEL
    figure = new_figure(width * columns, height * rows + TEXT_HEIGHT)
    grid = figure.add_gridspec(rows, columns)
    for number, draw in enumerate(panels):
        draw(figure, grid[divmod(number, columns)])
    text = fill(_reached_text(coverage), round(LETTERS_PER_INCH * width * columns))
    figure.suptitle(text, x=0.01, ha="left", fontsize=8.5, color=INK, parse_math=False)
    return figure


def _reached_text(coverage: Coverage) -> str:
    """Shares of configurations and workspace that are reached, with their definitions."""
    text = (
        f"{coverage.arm.name}, samples: {len(coverage.bends):,}; darker: more (log). "
        f"Reached: {_percent(coverage.reached_bends())} of random configurations within "
        "the limits of plans (a sample bends every module alike, within "
        f"{_percent(NEAR_BEND)} of its limit)"
    )
    share = coverage.reached_tips()
    if not np.isfinite(share):
        return f"{text}; the workspace is unknown without measured tips."
    return (
        f"{text}; {_percent(share)} of the nominal workspace (tips of random arcs with "
        f"a measured tip within {_percent(NEAR_TIP)} of the arm's length)."
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def _draw_pair(
    coverage: Coverage, inner: int, figure: Figure, place: SubplotSpec
) -> None:
    """Draw the density of the bends of two neighbors."""
    first = inner + 1  # modules count from one in figures
    second = inner + 2
    axes = new_axes(
        figure,
        place,
        f"bend of module {first} along that of {second} [deg]",
        f"bend of module {second} [deg]",
    )
    along, outer = map(np.rad2deg, coverage.neighboring_bends(inner))
    limits = np.rad2deg(coverage.limits[inner : inner + 2])
    right = max(limits[0], np.max(np.abs(along), initial=0.0))
    top = max(limits[1], np.max(outer, initial=0.0))
    _draw_density(axes, along, outer, (-right, right, 0.0, top))
    # the limits of plans, and the diagonal of equal bends
    sides = [-limits[0], -limits[0], limits[0], limits[0]]
    axes.plot(sides, [0.0, limits[1], limits[1], 0.0], **LIMIT_LINE)
    axes.plot([0.0, limits.min()], [0.0, limits.min()], **EQUAL_LINE)
    note(axes, 0.02, 0.985, "S shapes", va="top")
    note(axes, 0.98, 0.985, "equal bends: diagonal", va="top", ha="right")
    reached = coverage.reached_bends(slice(inner, inner + 2))
    opposed = coverage.opposed_share(inner)
    text = f"modules {first} and {second}: {_percent(reached)} reached"
    if np.isfinite(opposed):
        text += f", {_percent(opposed)} S"
    headline(axes, text)


def _draw_bend_plane(coverage: Coverage, figure: Figure, place: SubplotSpec) -> None:
    """Draw the density of the bends of the only module."""
    labels = ("bend along x [deg]", "bend along y [deg]")
    axes = new_axes(figure, place, *labels)
    x, y = np.rad2deg(coverage.bends[:, 0]).T
    limit = float(np.rad2deg(coverage.limits[0]))
    edge = max(limit, np.max(np.abs([x, y]), initial=0.0))
    _draw_density(axes, x, y, (-edge, edge, -edge, edge))
    around = np.linspace(0.0, 2.0 * np.pi, 91)
    axes.plot(limit * np.cos(around), limit * np.sin(around), **LIMIT_LINE)
    axes.set_aspect("equal")
    headline(axes, f"module 1: {_percent(coverage.reached_bends())} reached")


def _draw_density(
    axes: Axes, x: np.ndarray, y: np.ndarray, extent: tuple[float, float, float, float]
) -> None:
    """Draw the number of samples in hexagons, darker for more, on a log scale."""
    if not len(x):
        write_placeholder(axes, "no configurations")
        return
    left, right, bottom, top = extent
    height = (top - bottom) / (right - left)
    cells = max(2, round(CELLS * height * 0.58))
    axes.hexbin(
        x,
        y,
        gridsize=(CELLS, cells),
        extent=extent,
        bins="log",
        mincnt=1,
        cmap="YlGnBu",
        vmin=0.4,
        linewidths=0.2,
        rasterized=True,
    )
    margin = 0.04 * (right - left)
    axes.set_xlim(left - margin, right + margin)
    axes.set_ylim(bottom - (margin if bottom < 0.0 else 0.0), top + 0.14 * top)


def _draw_speeds(coverage: Coverage, figure: Figure, place: SubplotSpec) -> None:
    """Draw how much time the arm spends at each speed, and in holds."""
    axes = new_axes(figure, place, "speed of the fastest module [deg/s]", "time [%]")
    speeds = np.rad2deg(coverage.speeds)
    if not len(speeds):
        write_placeholder(axes, "no motion")
        return
    fastest = float(np.rad2deg(coverage.fastest))
    hold = HOLD * fastest
    edges = np.geomspace(hold, max(1.2 * fastest, speeds.max()), CELLS + 1)
    counts, _ = np.histogram(speeds, edges)
    share = 100.0 / len(speeds)
    axes.bar(
        edges[:-1], share * counts, np.diff(edges), align="edge", color=REAL, alpha=0.8
    )
    left = SLOWEST_SHOWN * hold
    holds = float(np.mean(speeds < hold))
    axes.bar(left, 100.0 * holds, hold - left, align="edge", color=MUTED)
    axes.axvline(fastest, **LIMIT_LINE)
    label_log_axis(axes)
    note(axes, 0.02, 0.985, "dashed: step limit", va="top")
    axes.margins(y=0.15)
    headline(axes, f"holds below {hold:.2g} deg/s (gray): {_percent(holds)}")
