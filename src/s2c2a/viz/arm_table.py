"""The table of an arm's modules, tied to its side view."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from s2c2a.arm import ArmSpec, Module
from s2c2a.viz.arm_side import DISC_WIDTH, SideView, module_ends
from s2c2a.viz.colours import FAINT, INK, MUTED, module_colours
from s2c2a.viz.cross_section import Kind

LEADER_WIDTH = 0.9  # inches from the side view to the first column
ROW_GAP = 0.24  # inches
NUMBER, SECTION = 1.55, 6.6  # right edges of the first and the last column, inches from the left of the table
QUANTITIES: dict[str, tuple[float, Callable[[Module], float]]] = {
    "length\n[mm]": (2.2, lambda module: 1000 * module.length),
    "cables at\n[mm]": (2.95, lambda module: 1000 * module.cable_radius),
    "mass\n[g]": (3.6, lambda module: 1000 * module.mass),
    "EI\n[N m²]": (4.35, lambda module: module.bending_stiffness),
    "GJ\n[N m²]": (5.1, lambda module: module.gj),
    "bend limit\n[deg]": (5.9, lambda module: module.bend_limit_deg),
}


def draw_table(axes: Axes, arm: ArmSpec, kinds: list[Kind], view: SideView, left: float, size: tuple[float, float]):
    """Write a row for each module; beside an arm that stands or hangs, tied to the module by a line.

    Args:
        axes: bare axes in inches that hold the side view too.
        arm: the arm.
        kinds: its cross-sections.
        view: its side view.
        left: where the table begins [inches].
        size: its width and height [inches].
    """
    width, height = size
    headings = {"module": NUMBER, **{name: right for name, (right, _) in QUANTITIES.items()}, "section": SECTION}
    for name, right in headings.items():
        style: dict[str, Any] = {"ha": "right", "va": "bottom", "color": MUTED, "linespacing": 1.25}
        axes.text(left + right, height + 0.1, name, fontsize=8, **style)
    axes.plot([left + LEADER_WIDTH, left + width], [height + 0.04] * 2, color=FAINT, linewidth=1, clip_on=False)
    letters = {number: kind.letter for kind in kinds for number in kind.numbers}
    middles = view.at((module_ends(arm)[:-1] + module_ends(arm)[1:]) / 2)[:, 1]
    order = np.argsort(middles, kind="stable") if view.upright else np.arange(arm.module_count)[::-1]
    rows = np.empty(arm.module_count)
    rows[order] = spread(middles[order], ROW_GAP, height)
    for place, (module, colour) in enumerate(zip(arm.modules, module_colours(arm.module_count), strict=True)):
        axes.plot(left + LEADER_WIDTH + 0.05, rows[place], "o", color=colour, markersize=4)
        if view.upright:
            edge = view.origin[0] + DISC_WIDTH * module.cable_radius / view.per_inch + 0.08
            x = [edge, left + 0.15, left + LEADER_WIDTH - 0.2, left + LEADER_WIDTH + 0.05]
            axes.plot(x, [middles[place]] * 2 + [rows[place]] * 2, color=colour, linewidth=0.8, alpha=0.8)
        numbers = [f"{quantity(module):.4g}" for _, quantity in QUANTITIES.values()]
        for right, text in zip(headings.values(), [str(place + 1), *numbers, letters[place + 1]], strict=True):
            axes.text(left + right, rows[place], text, ha="right", va="center_baseline", fontsize=9, color=INK)


def spread(places: np.ndarray, gap: float, height: float = 1.0) -> np.ndarray:
    """Rising places up to a height, moved so that they lie at least `gap` apart and half a gap off the edges."""
    steps = gap * np.arange(len(places))
    upward = np.maximum.accumulate(np.maximum(places - steps, gap / 2)) + steps
    return np.minimum(upward, height - gap / 2 - steps[::-1])
