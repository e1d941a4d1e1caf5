"""Drawing of an arm: side view to scale, table of modules, gravity, cross-sections.

The side view shows the straight arm as it is mounted. There is one cross-section for
each arrangement of cables.
"""

from dataclasses import dataclass
from pathlib import Path
from string import ascii_uppercase
from textwrap import shorten
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from s2c2a.arm import ArmSpec
from s2c2a.viz.arrays import PlanePoints, Points
from s2c2a.viz.charts import draw_arrow, save_figure
from s2c2a.viz.colors import BASE, FAINT, INK, MUTED, module_colors
from s2c2a.viz.mounting import SIDE, Mounting

MAX_DESCRIPTION = 104  # characters
SECTIONS_PER_ROW = 4

# multiples of the cable radius
MODULE_RADIUS = 1.22  # in cross-sections; an arm file does not state it
DISC_RADIUS = 1.15
BASE_RADIUS = 1.7
SIDE_WIDTH_NEEDED = 4.6  # for the arm and the numbers beside it

# inches
WIDTH = 11.0
HEADING_HEIGHT = 1.65
MARGIN = 0.2
SIDE_LEFT = 0.95
SIDE_WIDTH = 2.9
MAX_SIDE_HEIGHT = 4.2
END_MARGIN = 0.3  # free space at both ends of the arm together
BASE_HEIGHT = 0.09
TICK_GAP_UPRIGHT = 0.16  # smallest gap between numbered boundaries
TICK_GAP_LYING = 0.32
TABLE_WIDTH = 6.7
ROW_HEIGHT = 0.27
ROW_GAP = 0.24  # smallest gap between rows
SECTION_HEIGHT = 2.85

TABLE_LEFT = SIDE_WIDTH + 0.9
COLUMN_EDGES = (1.55, 2.2, 2.95, 3.6, 4.35, 5.1, 5.9, 6.6)  # right of the side view
QUANTITIES = (  # attribute of a module, factor, heading
    ("length", 1000, "length\n[mm]"),
    ("cable_radius", 1000, "cables at\n[mm]"),
    ("mass", 1000, "mass\n[g]"),
    ("bending_stiffness", 1, "EI\n[N m²]"),
    ("gj", 1, "GJ\n[N m²]"),
    ("bend_limit_deg", 1, "bend limit\n[deg]"),
)

GRAVITY_TAIL = (-0.45, 0.4)  # in axes from -1 to 1 around the base frame's origin


@dataclass(frozen=True, eq=False)
class SideView:
    """Map from the plane of the side view to paper [inches].

    Attributes:
        side: axis of the base frame that runs across the arm: 0 for x, 1 for y.
        directions: directions on paper, as columns: across and along the arm.
        per_inch: meters in an inch.
        origin: of the base frame, on paper [inches].
    """

    side: int
    directions: Float[np.ndarray, "2 2"]
    per_inch: float
    origin: Float[np.ndarray, "2"]

    @classmethod
    def of(cls, arm: ArmSpec, height: float) -> "SideView":
        """View of the centered arm at the largest scale that fits a height [inches]."""
        axes = _axes_on_paper(Mounting.of(arm))
        paper = np.array([SIDE_WIDTH, height])
        side = int(np.argmax(np.abs(axes[:, :2]).sum(axis=0)))
        along = np.abs(axes[:, 2])
        length_scale = arm.length / (paper @ along - END_MARGIN)
        width_scale = _width_needed(arm) / (paper @ (1 - along))
        per_inch = max(length_scale, width_scale)
        origin = (paper - axes[:, 2] * arm.length / per_inch) / 2
        return cls(side, axes[:, [side, 2]], per_inch, origin)

    @property
    def upright(self) -> bool:
        """Whether the arm runs up or down the paper."""
        return bool(self.directions[1, 1])

    def at(self, z, across=0.0) -> PlanePoints:
        """Points on paper [inches] at heights and distances across the arm [m]."""
        points = np.stack(np.broadcast_arrays(across, z), axis=-1)
        return self.origin + points @ self.directions.T / self.per_inch


def kinds_of_module(arm: ArmSpec) -> dict[str, list[int]]:
    """Group modules by their arrangement of cables.

    Returns:
        Numbers of the modules, from 1 at the base, for each letter from "A".
    """
    groups: dict[tuple, list[int]] = {}
    for number, module in enumerate(arm.modules, start=1):
        arrangement = (module.cable_radius, module.cable_angles_deg)
        groups.setdefault(arrangement, []).append(number)
    return dict(zip(ascii_uppercase, groups.values(), strict=False))


def arm_figure(arm: ArmSpec, path: str | Path) -> Path:
    """Draw the straight arm from the side, its modules, cross-sections and gravity.

    Args:
        arm: the arm.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: the name has another ending, or the file cannot be written.
    """
    mounting = Mounting.of(arm)
    kinds = kinds_of_module(arm)
    side_height = _side_height(arm, mounting)
    sections_height = SECTION_HEIGHT * -(-len(kinds) // SECTIONS_PER_ROW)
    height = HEADING_HEIGHT + side_height + 2 * MARGIN + sections_height
    figure = Figure(figsize=(WIDTH, height), facecolor="white")
    _write_heading(figure, arm)
    _draw_gravity(_add_axes(figure, WIDTH - 1.3, 0.12, 1.0, 1.0), mounting)
    view = SideView.of(arm, side_height)
    width = SIDE_WIDTH + TABLE_WIDTH
    axes = _add_axes(figure, SIDE_LEFT, HEADING_HEIGHT, width, side_height)
    axes.set(xlim=(0, width), ylim=(0, side_height))
    _draw_side(axes, arm, view)
    _draw_table(axes, arm, kinds, view, side_height)
    for place, (letter, numbers) in enumerate(kinds.items()):
        row, column = divmod(place, SECTIONS_PER_ROW)
        left = 0.3 + column * (WIDTH - 0.4) / SECTIONS_PER_ROW
        top = height - sections_height + row * SECTION_HEIGHT
        section = _add_axes(figure, left, top, 2.45, SECTION_HEIGHT - 0.15)
        _draw_cross_section(section, arm, letter, numbers)
    return save_figure(figure, path)


def spread(places: np.ndarray, gap: float, height: float = 1.0) -> np.ndarray:
    """Move ascending places between 0 and `height` at least `gap` apart.

    The first and the last stay half a gap away from the edges.
    """
    steps = gap * np.arange(len(places))
    upward = np.maximum.accumulate(np.maximum(places - steps, gap / 2)) + steps
    return np.minimum(upward, height - gap / 2 - steps[::-1])


def _side_height(arm: ArmSpec, mounting: Mounting) -> float:
    """Height of the side view and the table [inches]."""
    needed = 0.0
    if _axes_on_paper(mounting)[1, 2]:
        needed = arm.length * SIDE_WIDTH / _width_needed(arm) + END_MARGIN
    height = min(MAX_SIDE_HEIGHT, max(1.6, needed))
    return max(height, ROW_HEIGHT * arm.module_count)


def _axes_on_paper(mounting: Mounting) -> Points:
    """Base frame axes in the side view, as columns; one is zero (out of the page)."""
    axes, backward = mounting.flat(SIDE)
    return np.eye(3)[list(axes)] * np.where(backward, -1.0, 1.0)[:, None]


def _width_needed(arm: ArmSpec) -> float:
    """Width of the side view for the widest module and the numbers beside it [m]."""
    return SIDE_WIDTH_NEEDED * max(module.cable_radius for module in arm.modules)


def _module_ends(arm: ArmSpec) -> Float[np.ndarray, " ends"]:
    """Boundaries of the modules [m], from base to tip, shape (modules + 1,)."""
    return np.cumsum([0.0, *(module.length for module in arm.modules)])


def _add_axes(
    figure: Figure, left: float, top: float, width: float, height: float
) -> Axes:
    """Bare axes at a place in inches from the upper left corner."""
    page = np.tile(figure.get_size_inches(), 2)
    place = np.array([left, page[1] - top - height, width, height]) / page
    axes = figure.add_axes(tuple(place))
    axes.set_axis_off()
    return axes


def _write(axes: Axes, x: float, y: float, text: str, size: float, **style) -> None:
    """Write text centered at a point; `style` replaces alignment and color."""
    style = {"color": MUTED, "ha": "center", "va": "center", **style}
    axes.text(x, y, text, fontsize=size, **style)


def _write_heading(figure: Figure, arm: ArmSpec) -> None:
    """Write name, description and totals of the arm."""
    mass = sum(module.mass for module in arm.modules)
    modules = "1 module" if arm.module_count == 1 else f"{arm.module_count} modules"
    totals = (
        f"{modules} of {arm.cable_count} cables  ·  {arm.length:.4g} m  ·  "
        f"{mass:.4g} kg  ·  actuated by {arm.actuation}  ·  {arm.control_rate:.4g} Hz"
    )
    description = shorten(arm.description, MAX_DESCRIPTION, placeholder="…")
    lines = [(arm.name, 15.0, "bold", INK), (totals, 9, "normal", MUTED)]
    if description:
        lines.insert(1, (description, 9.5, "normal", INK))
    for row, (text, size, weight, color) in enumerate(lines):
        y = 1 - (0.42 + 0.27 * row) / figure.get_figheight()
        style: dict[str, Any] = {"fontsize": size, "fontweight": weight, "color": color}
        figure.text(0.4 / WIDTH, y, text, parse_math=False, **style)


def _draw_gravity(axes: Axes, mounting: Mounting) -> None:
    """Draw gravity beside the base frame's axes, and name the mounting."""
    axes.set(xlim=(-1, 1), ylim=(-1, 1), aspect="equal")
    directions = _axes_on_paper(mounting)
    for name, end in zip("xyz", directions.T, strict=True):
        if end.any():
            draw_arrow(axes, (0.0, 0.0), 0.38 * end, MUTED, 0.8, head=0.0)
            _write(axes, 0.51 * end[0], 0.51 * end[1], name, 7.5)
    text = "no gravity"
    if mounting.gravity.any():
        text = f"gravity\nthe arm {mounting.word}"
        tip = GRAVITY_TAIL + 0.8 * directions @ mounting.gravity
        draw_arrow(axes, GRAVITY_TAIL, tip, INK, 2.2, head=15.0)
    _write(axes, -0.95, 0, text, 8.5, color=INK, ha="right", linespacing=1.3)


def _draw_side(axes: Axes, arm: ArmSpec, view: SideView) -> None:
    """Draw the straight arm with its cables, and number its boundaries [mm]."""
    ends = _module_ends(arm)
    colors = module_colors(arm.module_count)
    for module, low, high, color in zip(
        arm.modules, ends, ends[1:], colors, strict=False
    ):
        radius = module.cable_radius
        _draw_box(axes, view, (low, high), radius, color + "38")
        angles = np.deg2rad(np.subtract(module.cable_angles_deg, 90.0 * view.side))
        for offset in radius * np.cos(angles):
            cable = view.at([low, high], offset)
            axes.plot(*cable.T, color=color, linewidth=1.2)
        disc = view.at(high, DISC_RADIUS * radius * np.array([-1, 1]))
        axes.plot(*disc.T, color=INK, linewidth=1.8, solid_capstyle="butt")
    bottom = -BASE_HEIGHT * view.per_inch
    base_radius = BASE_RADIUS * arm.modules[0].cable_radius
    _draw_box(axes, view, (bottom, 0.0), base_radius, BASE)
    _number_boundaries(axes, ends, view, _width_needed(arm) / view.per_inch / 2)


def _draw_box(
    axes: Axes, view: SideView, heights: tuple[float, float], radius: float, color: str
) -> None:
    corners = view.at(np.repeat(heights, 2), radius * np.array([-1, 1, 1, -1]))
    axes.add_patch(Polygon(corners, facecolor=color, edgecolor="none"))


def _number_boundaries(
    axes: Axes, ends: np.ndarray, view: SideView, distance: float
) -> None:
    """Write heights beside an upright arm, or a distance [inches] below a lying arm."""
    if view.upright:
        offset = np.array([-0.49 * SIDE_WIDTH, 0.0])
        style = {"ha": "right"}
        gap = TICK_GAP_UPRIGHT * view.per_inch
        label_at = ends[-1] + 0.28 * view.per_inch
    else:
        offset = np.array([0.0, -distance])
        style = {"va": "top"}
        gap = TICK_GAP_LYING * view.per_inch
        label_at = ends[-1] + 0.5 * view.per_inch
    labels = {end: f"{1000 * end:.4g}" for end in _separated(ends, gap)}
    labels[label_at] = "z [mm]"
    for height, text in labels.items():
        x, y = view.at(height) + offset
        _write(axes, x, y, text, 8, **style)
    for end in ends:
        tick = view.at(end) + offset - np.outer([0.06, 0.16], np.sign(offset))
        axes.plot(*tick.T, color=MUTED, linewidth=0.8)


def _separated(ends: np.ndarray, gap: float) -> list[float]:
    """Boundaries more than a gap apart from each other and the base, from the tip."""
    shown = [ends[-1]]
    for end in ends[-2::-1]:
        if shown[-1] - end > gap and (end == 0 or end > gap):
            shown.append(end)
    return shown


def _draw_table(
    axes: Axes, arm: ArmSpec, kinds: dict[str, list[int]], view: SideView, height: float
) -> None:
    """Write a row for each module; lines connect the rows to an upright arm.

    Args:
        axes: bare axes in inches that also hold the side view.
        arm: the arm.
        kinds: module numbers of each cross-section.
        view: side view of the arm.
        height: of the table [inches].
    """
    headings = ["module", *(heading for _, _, heading in QUANTITIES), "section"]
    _write_row(axes, height + 0.1, headings, 8, va="bottom", linespacing=1.25)
    rule = [TABLE_LEFT, SIDE_WIDTH + TABLE_WIDTH]
    axes.plot(rule, [height + 0.04] * 2, color=FAINT, linewidth=1, clip_on=False)

    ends = _module_ends(arm)
    middles = view.at((ends[:-1] + ends[1:]) / 2)[:, 1]
    rows = _row_heights(middles, view, height)
    letters = {number: letter for letter, group in kinds.items() for number in group}
    colors = module_colors(arm.module_count)
    for place, (module, color) in enumerate(zip(arm.modules, colors, strict=True)):
        row = rows[place]
        axes.plot(TABLE_LEFT + 0.05, row, "o", color=color, markersize=4)
        if view.upright:
            disc = DISC_RADIUS * module.cable_radius / view.per_inch
            edge = view.origin[0] + disc + 0.08
            x = [edge, SIDE_WIDTH + 0.15, TABLE_LEFT - 0.2, TABLE_LEFT + 0.05]
            y = [middles[place], middles[place], row, row]
            axes.plot(x, y, color=color, linewidth=0.8, alpha=0.8)
        cells = [str(place + 1)]
        for name, factor, _ in QUANTITIES:
            cells.append(f"{factor * getattr(module, name):.4g}")
        cells.append(letters[place + 1])
        _write_row(axes, row, cells, 9, va="center_baseline", color=INK)


def _write_row(axes: Axes, y: float, cells: list[str], size: float, **style) -> None:
    for edge, text in zip(COLUMN_EDGES, cells, strict=True):
        _write(axes, SIDE_WIDTH + edge, y, text, size, ha="right", **style)


def _row_heights(middles: np.ndarray, view: SideView, height: float) -> np.ndarray:
    """Heights of the table's rows [inches], close to the modules of an upright arm."""
    order = np.arange(len(middles))[::-1]
    if view.upright:
        order = np.argsort(middles, kind="stable")
    rows = np.empty(len(middles))
    rows[order] = spread(middles[order], ROW_GAP, height)
    return rows


def _draw_cross_section(
    axes: Axes, arm: ArmSpec, letter: str, numbers: list[int]
) -> None:
    """Draw a section seen from the tip: x to the right, y up; number its cables."""
    axes.set(xlim=(-2.1, 2.1), ylim=(-1.95, 2.85), aspect="equal")
    module = arm.modules[numbers[0] - 1]
    color = module_colors(arm.module_count)[numbers[0] - 1]
    fill = {"facecolor": color + "1f", "edgecolor": color, "linewidth": 1.4}
    axes.add_patch(Circle((0, 0), MODULE_RADIUS, **fill))
    dashes = {"edgecolor": MUTED, "linewidth": 0.8, "linestyle": (0, (3, 3))}
    axes.add_patch(Circle((0, 0), 1, facecolor="none", **dashes))
    for end, name in (((0.5, 0.0), "x"), ((0.0, 0.5), "y")):
        draw_arrow(axes, (0.0, 0.0), end, MUTED, 0.9, head=8.0)
        _write(axes, 1.3 * end[0], 1.3 * end[1], name, 8)
    for number, angle in enumerate(module.cable_angles_deg, start=1):
        _draw_cable(axes, number, angle, color)
    style = {"color": INK, "ha": "left", "va": "baseline"}
    word = "module" if len(numbers) == 1 else "modules"
    text = f"{word} {_number_ranges(numbers)}"
    _write(axes, -2.05, 2.55, letter, 12, fontweight="bold", **style)
    _write(axes, -1.68, 2.55, text, 9, **style)
    text = f"cables at {1000 * module.cable_radius:.4g} mm"
    _write(axes, -1.68, 2.22, text, 8.5, ha="left", va="baseline")


def _draw_cable(axes: Axes, number: int, angle: float, color: str) -> None:
    """Draw a numbered cable on the unit circle at an angle [deg]."""
    x = np.cos(np.deg2rad(angle))
    y = np.sin(np.deg2rad(angle))
    axes.plot(x, y, "o", color=color, markersize=13, mec="white", mew=1)
    style = {"color": "white", "va": "center_baseline", "fontweight": "bold"}
    _write(axes, x, y, str(number), 7.5, **style)
    _write(axes, 1.62 * x, 1.62 * y, f"{angle:g}°", 8, color=INK)


def _number_ranges(numbers: list[int]) -> str:
    """Ascending numbers as ranges such as "1–3, 5", shortened if there are many."""
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    spans = [str(run[0]) if len(run) == 1 else f"{run[0]}–{run[-1]}" for run in runs]
    if len(spans) > 5:
        spans = [*spans[:3], "…", spans[-1]]
    return ", ".join(spans)
