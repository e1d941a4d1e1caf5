"""A drawing of an arm: side view to scale, table of modules, gravity, a cross-section for each kind of module."""

import os
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from s2c2a.arm import ArmSpec
from s2c2a.viz.arm_side import SIDE_WIDTH, SideView, draw_gravity, draw_side, fitting_height
from s2c2a.viz.arm_table import draw_table
from s2c2a.viz.colours import INK, MUTED
from s2c2a.viz.cross_section import Kind, draw_cross_section, kinds_of_module
from s2c2a.viz.mounting import Mounting
from s2c2a.viz.saving import save_figure

WIDTH, HEADING, MARGIN = 11.0, 1.65, 0.2  # inches
SIDE_LEFT, TABLE_WIDTH = 0.95, 6.7
SIDE_HEIGHT, ROW_HEIGHT = 4.2, 0.27
SECTIONS_IN_A_ROW, SECTION_HEIGHT = 4, 2.85


def arm_figure(arm: ArmSpec, path: str | os.PathLike) -> Path:
    """Draw the straight arm as it is mounted, from the side and to scale, its modules, cables and gravity.

    Args:
        arm: the arm.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: the name ends in another format, or the file cannot be written.
    """
    kinds = kinds_of_module(arm)
    side_height = max(fitting_height(arm, SIDE_HEIGHT), ROW_HEIGHT * arm.module_count)
    sections_height = SECTION_HEIGHT * -(-len(kinds) // SECTIONS_IN_A_ROW)
    height = HEADING + side_height + 2 * MARGIN + sections_height
    figure = Figure(figsize=(WIDTH, height), facecolor="white")
    _write_heading(figure, arm)
    draw_gravity(_axes(figure, WIDTH - 1.3, 0.12, 1.0, 1.0), Mounting.of(arm))
    view = SideView.of(arm, side_height)
    axes = _axes(figure, SIDE_LEFT, HEADING, SIDE_WIDTH + TABLE_WIDTH, side_height)
    axes.set(xlim=(0, SIDE_WIDTH + TABLE_WIDTH), ylim=(0, side_height))
    draw_side(axes, arm, view)
    draw_table(axes, arm, kinds, view, SIDE_WIDTH, (TABLE_WIDTH, side_height))
    _draw_sections(figure, kinds, HEADING + side_height + 2 * MARGIN)
    return save_figure(figure, path)


def _draw_sections(figure: Figure, kinds: list[Kind], top: float) -> None:
    """Cross-sections in rows, the first one `top` inches below the upper edge."""
    for place, kind in enumerate(kinds):
        row, column = divmod(place, SECTIONS_IN_A_ROW)
        left = 0.3 + column * (WIDTH - 0.4) / SECTIONS_IN_A_ROW
        axes = _axes(figure, left, top + row * SECTION_HEIGHT, 2.45, SECTION_HEIGHT - 0.15)
        draw_cross_section(axes, kind)


def _axes(figure: Figure, left: float, top: float, width: float, height: float) -> Axes:
    """Bare axes at a place in inches from the upper left corner."""
    page_width, page_height = figure.get_size_inches()
    bottom = page_height - top - height
    axes = figure.add_axes((left / page_width, bottom / page_height, width / page_width, height / page_height))
    axes.set_axis_off()
    return axes


def _write_heading(figure: Figure, arm: ArmSpec) -> None:
    """Name, what it is for, and the numbers of the whole arm."""
    lines = [
        (arm.name, 15, "bold", INK),
        (_shortened(arm.description), 9.5, "normal", INK),
        (_facts(arm), 9, "normal", MUTED),
    ]
    for row, (text, size, weight, colour) in enumerate(line for line in lines if line[0]):
        place = 1 - (0.42 + 0.27 * row) / figure.get_figheight()
        style: dict[str, Any] = {"fontsize": size, "fontweight": weight, "color": colour, "parse_math": False}
        figure.text(0.4 / WIDTH, place, text, **style)


def _facts(arm: ArmSpec) -> str:
    mass = sum(module.mass for module in arm.modules)
    modules = "1 module" if arm.module_count == 1 else f"{arm.module_count} modules"
    size = f"{modules} of {arm.cable_count} cables  ·  {arm.length:.4g} m  ·  {mass:.4g} kg"
    return f"{size}  ·  actuated by {arm.actuation}  ·  {arm.control_rate:.4g} Hz"


def _shortened(text: str, most: int = 104) -> str:
    text = " ".join(text.split())
    return text if len(text) <= most else text[: most - 1] + "…"
