"""The table of an arm's modules, tied to its side view."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from s2c2a.arm import ArmSpec, Module
from s2c2a.viz.arm_side import DISC_WIDTH, SideScale, module_ends
from s2c2a.viz.colours import FAINT, INK, MUTED, module_colours
from s2c2a.viz.cross_section import Kind

LEADER_WIDTH = 0.9  # inches from the side view to the first column
ROW_GAP = 0.24  # inches


@dataclass(frozen=True)
class Row:
    """A module, its number counted from 1 at the base, and the letter of its cross-section."""

    module: Module
    number: int
    letter: str


@dataclass(frozen=True)
class Column:
    """Heading, right edge in inches from the left of the table, and what stands below it."""

    heading: str
    right: float
    text: Callable[[Row], str]


COLUMNS = (
    Column("module", 1.55, lambda row: str(row.number)),
    Column("length\n[mm]", 2.2, lambda row: f"{1000 * row.module.length:.4g}"),
    Column("cables at\n[mm]", 2.95, lambda row: f"{1000 * row.module.cable_radius:.4g}"),
    Column("mass\n[g]", 3.6, lambda row: f"{1000 * row.module.mass:.4g}"),
    Column("EI\n[N m²]", 4.35, lambda row: f"{row.module.bending_stiffness:.4g}"),
    Column("GJ\n[N m²]", 5.1, lambda row: f"{row.module.gj:.4g}"),
    Column("bend limit\n[deg]", 5.9, lambda row: f"{row.module.bend_limit_deg:.4g}"),
    Column("section", 6.6, lambda row: row.letter),
)


def draw_table(axes: Axes, arm: ArmSpec, kinds: list[Kind], scale: SideScale, size: tuple[float, float]) -> None:
    """Write a row for each module, tip on top, tied to its module in the side view by a line.

    Args:
        axes: bare axes right of the side view, as high as it is.
        arm: the arm.
        kinds: its cross-sections.
        scale: scale of the side view.
        size: width and height of the axes [inches].
    """
    width, height = size
    axes.set(xlim=(0, width), ylim=(0, 1))
    _write_headings(axes, width, height)
    letters = {number: kind.letter for kind in kinds for number in kind.numbers}
    middles = scale.share((module_ends(arm)[:-1] + module_ends(arm)[1:]) / 2)
    heights = spread(middles, ROW_GAP / height)
    for place, (module, colour) in enumerate(zip(arm.modules, module_colours(arm.module_count), strict=True)):
        edge = (DISC_WIDTH * module.cable_radius - scale.half_width) / scale.per_inch
        _tie(axes, (edge, middles[place]), heights[place], colour)
        _write_row(axes, Row(module, place + 1, letters[place + 1]), heights[place])


def _write_headings(axes: Axes, width: float, height: float) -> None:
    for column in COLUMNS:
        style: dict[str, Any] = {"ha": "right", "va": "bottom", "color": MUTED, "linespacing": 1.25}
        axes.text(column.right, 1 + 0.1 / height, column.heading, fontsize=8, **style)
    axes.plot([LEADER_WIDTH, width], [1 + 0.04 / height] * 2, color=FAINT, linewidth=1, clip_on=False)


def spread(places: np.ndarray, gap: float) -> np.ndarray:
    """Rising places in [0, 1], moved so that they lie at least `gap` apart and half a gap off the edges."""
    steps = gap * np.arange(len(places))
    upward = np.maximum.accumulate(np.maximum(places - steps, gap / 2)) + steps
    highest = 1 - gap / 2 - steps[::-1]
    return np.minimum(upward, highest)


def _tie(axes: Axes, start: tuple[float, float], end: float, colour: str) -> None:
    """A line from the edge of a module to its row that ends in a dot."""
    x = [start[0] + 0.08, 0.15, LEADER_WIDTH - 0.2, LEADER_WIDTH + 0.05]
    axes.plot(x, [start[1], start[1], end, end], color=colour, linewidth=0.8, alpha=0.8, clip_on=False)
    axes.plot(x[-1], end, "o", color=colour, markersize=4)


def _write_row(axes: Axes, row: Row, height: float) -> None:
    for column in COLUMNS:
        axes.text(column.right, height, column.text(row), ha="right", va="center_baseline", fontsize=9, color=INK)
