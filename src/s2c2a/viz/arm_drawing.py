"""A drawing of an arm: side view to scale, table of modules, gravity, a cross-section for each kind of module."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from string import ascii_uppercase
from textwrap import shorten

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from s2c2a.arm import ArmSpec, Module
from s2c2a.viz.arm_side import DISC_WIDTH, SIDE_WIDTH, SideView, draw_gravity, draw_side, fitting_height, module_ends
from s2c2a.viz.charts import draw_arrow, save_figure
from s2c2a.viz.colours import FAINT, INK, MUTED, module_colours
from s2c2a.viz.mounting import Mounting

LONGEST = 104  # letters of a description
WIDTH, HEADING, MARGIN = 11.0, 1.65, 0.2  # inches
SIDE_LEFT, TABLE_WIDTH = 0.95, 6.7
SIDE_HEIGHT, ROW_HEIGHT = 4.2, 0.27
SECTIONS_IN_A_ROW, SECTION_HEIGHT = 4, 2.85
COLUMNS = SIDE_WIDTH + 0.9  # left edge of the first column, inches from the left of the side view, as the next ones
ROW_GAP = 0.24  # inches
NUMBER, SECTION = SIDE_WIDTH + 1.55, SIDE_WIDTH + 6.6  # right edges of the first and the last column
QUANTITIES: dict[str, tuple[float, Callable[[Module], float]]] = {
    "length\n[mm]": (SIDE_WIDTH + 2.2, lambda module: 1000 * module.length),
    "cables at\n[mm]": (SIDE_WIDTH + 2.95, lambda module: 1000 * module.cable_radius),
    "mass\n[g]": (SIDE_WIDTH + 3.6, lambda module: 1000 * module.mass),
    "EI\n[N m²]": (SIDE_WIDTH + 4.35, lambda module: module.bending_stiffness),
    "GJ\n[N m²]": (SIDE_WIDTH + 5.1, lambda module: module.gj),
    "bend limit\n[deg]": (SIDE_WIDTH + 5.9, lambda module: module.bend_limit_deg),
}
BODY = 1.22  # radius of the body drawn, as a share of the cable radius; an arm file does not state it


@dataclass(frozen=True)
class Kind:
    """Modules whose cables run alike.

    Attributes:
        letter: name of the section, "A" for the kind nearest to the base.
        module: one of them.
        numbers: which modules they are, counted from 1 at the base.
        colour: of the first of them.
    """

    letter: str
    module: Module
    numbers: tuple[int, ...]
    colour: str


def kinds_of_module(arm: ArmSpec) -> list[Kind]:
    """Modules grouped by radius and angles of their cables, in order from the base."""
    groups: dict[tuple, list[int]] = {}
    for place, module in enumerate(arm.modules):
        groups.setdefault((module.cable_radius, module.cable_angles_deg), []).append(place)
    colours = module_colours(arm.module_count)
    return [
        Kind(letter, arm.modules[places[0]], tuple(place + 1 for place in places), colours[places[0]])
        for letter, places in zip(ascii_uppercase, groups.values(), strict=False)
    ]


def arm_figure(arm: ArmSpec, path: str | Path) -> Path:
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
    _draw_table(axes, arm, kinds, view, side_height)
    for place, kind in enumerate(kinds):
        row, column = divmod(place, SECTIONS_IN_A_ROW)
        left, top = 0.3 + column * (WIDTH - 0.4) / SECTIONS_IN_A_ROW, height - sections_height + row * SECTION_HEIGHT
        _draw_cross_section(_axes(figure, left, top, 2.45, SECTION_HEIGHT - 0.15), kind)
    return save_figure(figure, path)


def _axes(figure: Figure, left: float, top: float, width: float, height: float) -> Axes:
    """Bare axes at a place in inches from the upper left corner."""
    page_width, page_height = figure.get_size_inches()
    bottom = page_height - top - height
    axes = figure.add_axes((left / page_width, bottom / page_height, width / page_width, height / page_height))
    axes.set_axis_off()
    return axes


def _write_heading(figure: Figure, arm: ArmSpec) -> None:
    """Name, what it is for, and the numbers of the whole arm."""
    mass = sum(module.mass for module in arm.modules)
    modules = "1 module" if arm.module_count == 1 else f"{arm.module_count} modules"
    whole = f"{modules} of {arm.cable_count} cables  ·  {arm.length:.4g} m  ·  {mass:.4g} kg"
    lines = [
        (arm.name, 15, "bold", INK),
        (shorten(arm.description, LONGEST, placeholder="…"), 9.5, "normal", INK),
        (f"{whole}  ·  actuated by {arm.actuation}  ·  {arm.control_rate:.4g} Hz", 9, "normal", MUTED),
    ]
    for row, (text, size, weight, colour) in enumerate(line for line in lines if line[0]):
        place = 1 - (0.42 + 0.27 * row) / figure.get_figheight()
        figure.text(0.4 / WIDTH, place, text, fontsize=size, fontweight=weight, color=colour, parse_math=False)


def _draw_table(axes: Axes, arm: ArmSpec, kinds: list[Kind], view: SideView, height: float) -> None:
    """Write a row for each module; beside an arm that stands or hangs, tied to the module by a line.

    Args:
        axes: bare axes in inches that hold the side view too.
        arm: the arm.
        kinds: its cross-sections.
        view: its side view.
        height: of the table [inches].
    """
    headings = {"module": NUMBER, **{name: right for name, (right, _) in QUANTITIES.items()}, "section": SECTION}
    for name, right in headings.items():
        axes.text(right, height + 0.1, name, fontsize=8, color=MUTED, ha="right", va="bottom", linespacing=1.25)
    axes.plot([COLUMNS, SIDE_WIDTH + TABLE_WIDTH], [height + 0.04] * 2, color=FAINT, linewidth=1, clip_on=False)
    letters = {number: kind.letter for kind in kinds for number in kind.numbers}
    middles = view.at((module_ends(arm)[:-1] + module_ends(arm)[1:]) / 2)[:, 1]
    order = np.argsort(middles, kind="stable") if view.upright else np.arange(arm.module_count)[::-1]
    rows = np.empty(arm.module_count)
    rows[order] = spread(middles[order], ROW_GAP, height)
    for place, (module, colour) in enumerate(zip(arm.modules, module_colours(arm.module_count), strict=True)):
        axes.plot(COLUMNS + 0.05, rows[place], "o", color=colour, markersize=4)
        if view.upright:
            edge = view.origin[0] + DISC_WIDTH * module.cable_radius / view.per_inch + 0.08
            x = [edge, SIDE_WIDTH + 0.15, COLUMNS - 0.2, COLUMNS + 0.05]
            axes.plot(x, [middles[place]] * 2 + [rows[place]] * 2, color=colour, linewidth=0.8, alpha=0.8)
        numbers = [f"{quantity(module):.4g}" for _, quantity in QUANTITIES.values()]
        for right, text in zip(headings.values(), [str(place + 1), *numbers, letters[place + 1]], strict=True):
            axes.text(right, rows[place], text, ha="right", va="center_baseline", fontsize=9, color=INK)


def spread(places: np.ndarray, gap: float, height: float = 1.0) -> np.ndarray:
    """Rising places up to a height, moved so that they lie at least `gap` apart and half a gap off the edges."""
    steps = gap * np.arange(len(places))
    upward = np.maximum.accumulate(np.maximum(places - steps, gap / 2)) + steps
    return np.minimum(upward, height - gap / 2 - steps[::-1])


def _draw_cross_section(axes: Axes, kind: Kind) -> None:
    """Draw a section seen from the tip towards the base: x to the right, y up, cables numbered from 1."""
    axes.set(xlim=(-2.1, 2.1), ylim=(-1.95, 2.85), aspect="equal")
    axes.set_axis_off()
    axes.add_patch(Circle((0, 0), BODY, facecolor=kind.colour + "1f", edgecolor=kind.colour, linewidth=1.4))
    axes.add_patch(Circle((0, 0), 1, facecolor="none", edgecolor=MUTED, linewidth=0.8, linestyle=(0, (3, 3))))
    for end, name in (((0.5, 0.0), "x"), ((0.0, 0.5), "y")):
        draw_arrow(axes, (0.0, 0.0), end, MUTED, 0.9, head=8.0)
        axes.text(1.3 * end[0], 1.3 * end[1], name, fontsize=8, color=MUTED, ha="center", va="center")
    for number, angle in enumerate(kind.module.cable_angles_deg, start=1):
        x, y = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
        axes.plot(x, y, "o", color=kind.colour, markersize=13, markeredgecolor="white", markeredgewidth=1)
        axes.text(x, y, str(number), fontsize=7.5, fontweight="bold", color="white", ha="center", va="center_baseline")
        axes.text(1.62 * x, 1.62 * y, f"{angle:g}°", fontsize=8, color=INK, ha="center", va="center")
    word = "module" if len(kind.numbers) == 1 else "modules"
    axes.text(-2.05, 2.55, kind.letter, fontsize=12, fontweight="bold", color=INK)
    axes.text(-1.68, 2.55, f"{word} {_ranges(kind.numbers)}", fontsize=9, color=INK)
    axes.text(-1.68, 2.22, f"cables at {1000 * kind.module.cable_radius:.4g} mm", fontsize=8.5, color=MUTED)


def _ranges(numbers: tuple[int, ...]) -> str:
    """Numbers as a list of ranges, such as "1–3, 5"; only the first and last ones where that is long."""
    spans = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    words = [str(span[0]) if len(span) == 1 else f"{span[0]}–{span[-1]}" for span in spans]
    return ", ".join(words if len(words) < 6 else [*words[:3], "…", words[-1]])
