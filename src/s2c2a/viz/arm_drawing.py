"""Drawing of an arm: side view to scale, table of modules, gravity, cross-sections.

The side view shows the straight arm as it is mounted. There is one cross-section for
each arrangement of cables.
"""

from pathlib import Path
from string import ascii_uppercase
from textwrap import shorten
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.patches import Circle, Polygon
from matplotlib.transforms import Bbox

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import directions_at
from s2c2a.viz.charts import draw_arrow, new_figure, save_figure
from s2c2a.viz.colors import BASE, FAINT, INK, MUTED, module_colors
from s2c2a.viz.mesh import COLLAR, DISC_RADIUS
from s2c2a.viz.mounting import SIDE, Mounting

COLUMNS = 4  # of the figure; a cross-section takes one, the table three
HEADING, SIDE_VIEW, TABLE_ROW, SECTION = 1.0, 3.4, 0.27, 2.7  # heights [inches]
MAX_NUMBERED = 10  # boundaries of modules with a number

QUANTITIES = (  # attribute of a module, factor, heading
    ("length", 1000, "length\n[mm]"),
    ("cable_radius", 1000, "cables at\n[mm]"),
    ("radius", 1000, "body radius\n[mm]"),
    ("mass", 1000, "mass\n[g]"),
    ("bending_stiffness", 1, "EI\n[N m²]"),
    ("gj", 1, "GJ\n[N m²]"),
    ("bend_limit_deg", 1, "bend limit\n[deg]"),
)


def kinds_of_module(arm: ArmSpec) -> dict[str, list[int]]:
    """Group modules by their body and arrangement of cables.

    Returns:
        Numbers of the modules, from 1 at the base, for each letter from "A".
    """
    groups: dict[tuple, list[int]] = {}
    for number, module in enumerate(arm.modules, start=1):
        arrangement = (module.radius, module.cable_radius, module.cable_angles_deg)
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
    kinds = kinds_of_module(arm)
    rows = -(-len(kinds) // COLUMNS)
    side_height = max(SIDE_VIEW, TABLE_ROW * (arm.module_count + 2))
    heights = [HEADING, side_height, *[SECTION] * rows]
    figure = new_figure(11.0, sum(heights))
    grid = figure.add_gridspec(len(heights), COLUMNS, height_ratios=heights)
    # write the arm's name, description and totals
    axes = _bare_axes(figure, grid[0, :-1])
    totals = f"{arm}, {arm.control_rate:.4g} Hz".removeprefix(f"{arm.name}, ")
    description = shorten(arm.description, 104, placeholder="…")
    left: dict[str, Any] = {"ha": "left", "va": "top"}
    _write(axes, (0, 1), arm.name, 15, fontweight="bold", **(left | {"color": INK}))
    _write(axes, (0, 0.6), "\n".join(filter(None, [description, totals])), 9, **left)
    _draw_gravity(_bare_axes(figure, grid[0, -1]), Mounting.of(arm))
    _draw_side(_bare_axes(figure, grid[1, 0]), arm)
    _draw_table(_bare_axes(figure, grid[1, 1:]), arm, kinds, side_height)
    for place, (letter, numbers) in enumerate(kinds.items()):
        row, column = divmod(place, COLUMNS)
        section = _bare_axes(figure, grid[2 + row, column])
        _draw_cross_section(section, arm, letter, numbers)
    return save_figure(figure, path)


def _bare_axes(figure: Figure, place: SubplotSpec) -> Axes:
    """Axes without frame and ticks."""
    axes = figure.add_subplot(place, frameon=False)
    axes.set(xticks=[], yticks=[])
    axes.tick_params(colors=MUTED, labelsize=8)
    return axes


def _write(axes: Axes, place, text: str, size: float, **style: Any) -> None:
    """Write text centered at a point; `style` replaces alignment and color."""
    style = {"ha": "center", "va": "center", "color": MUTED} | style
    axes.text(place[0], place[1], text, parse_math=False, fontsize=size, **style)


def _directions(mounting: Mounting) -> Float[np.ndarray, "2 3"]:
    """Base frame axes in the side view, as columns; one is zero (out of the page)."""
    axes, backward = mounting.flat(SIDE)
    return np.eye(3)[list(axes)] * np.where(backward, -1.0, 1.0)[:, None]


def _draw_gravity(axes: Axes, mounting: Mounting) -> None:
    """Draw gravity beside the base frame's axes, and name the mounting."""
    axes.set(xlim=(-1, 1), ylim=(-1, 1), aspect="equal")
    directions = _directions(mounting)
    for name, end in zip("xyz", directions.T, strict=True):
        if end.any():
            draw_arrow(axes, (0.0, 0.0), 0.6 * end, MUTED, 0.8, head=0.0)
            _write(axes, 0.85 * end, name, 8)
    text = "no gravity"
    if mounting.gravity.any():
        text = f"gravity\nthe arm {mounting.word}"
        tail = np.array([-0.6, 0.6])
        tip = tail + 1.2 * directions @ mounting.gravity
        draw_arrow(axes, tail, tip, INK, 2.2, head=15.0)
    _write(axes, (-1.5, 0), text, 8.5, color=INK, ha="right")


def _draw_side(axes: Axes, arm: ArmSpec) -> None:
    """Draw the straight arm with its cables [m], and number its boundaries [mm].

    Without a radius in the arm file, the body ends at the cables.
    """
    directions = _directions(Mounting.of(arm))
    side = int(np.argmax(np.abs(directions[:, :2]).sum(axis=0)))
    axes.set_aspect("equal")

    plane = directions[:, [side, 2]].T

    def at(z, across):
        return np.stack(np.broadcast_arrays(across, z), axis=-1) @ plane

    def draw_box(z, radius: float, color: str) -> None:
        across = radius * np.array([-1, 1, 1, -1])
        corners = at(np.repeat(z, 2), across)
        axes.add_patch(Polygon(corners, facecolor=color, edgecolor="none"))

    ends = np.cumsum([0.0, *(module.length for module in arm.modules)])
    base = COLLAR[0][1] * arm.modules[0].cable_radius
    draw_box((-0.02 * arm.length, 0.0), base, BASE)
    colors = module_colors(arm.module_count)
    for module, low, high, color in zip(
        arm.modules, ends, ends[1:], colors, strict=False
    ):
        radius = module.cable_radius
        draw_box((low, high), module.radius or radius, color + "38")
        angles_deg = np.subtract(module.cable_angles_deg, 90.0 * side)
        offsets = radius * np.cos(np.deg2rad(angles_deg))
        for offset in offsets:
            cable = at([low, high], offset)
            axes.plot(*cable.T, color=color, linewidth=1.2)
        disc = at(high, DISC_RADIUS * radius * np.array([-1, 1]))
        axes.plot(*disc.T, color=INK, linewidth=1.8, solid_capstyle="butt")
    numbered = ends[:: -(-len(ends) // MAX_NUMBERED)]
    labels = [f"{1000 * end:.4g}" for end in numbered]
    axis = axes.yaxis if directions[1, 2] else axes.xaxis
    axis.set_ticks(directions[:, 2].sum() * numbered, labels)
    axis.set_label_text("z [mm]", color=MUTED, fontsize=8)


def _draw_table(
    axes: Axes, arm: ArmSpec, kinds: dict[str, list[int]], height: float
) -> None:
    """Write a row for each module, in the order of the side view, from the top.

    Args:
        axes: bare axes.
        arm: the arm.
        kinds: module numbers of each cross-section.
        height: of the axes [inches].
    """
    letters = {number: letter for letter, group in kinds.items() for number in group}
    rows = []
    for number, module in enumerate(arm.modules, start=1):
        cells = [
            f"{factor * getattr(module, name):.4g}" for name, factor, _ in QUANTITIES
        ]
        rows.append([str(number), *cells, letters[number]])
    colors = module_colors(arm.module_count)
    if _directions(Mounting.of(arm))[1, 2] > 0:  # the tip is at the top
        rows.reverse()
        colors.reverse()
    headings = ["module", *(heading for _, _, heading in QUANTITIES), "section"]
    share = TABLE_ROW * (len(rows) + 2) / height
    table = axes.table(
        rows,
        colLabels=headings,
        edges="B",
        bbox=Bbox.from_bounds(0, 1 - share, 1, share),
    )
    table.auto_set_font_size(False)
    table.set_fontsize(9)
    for (row, column), cell in table.get_celld().items():
        cell.set(edgecolor=FAINT, height=1 if row else 2)
        cell.set_text_props(color=INK if row else MUTED)
        if row and not column:
            cell.set_text_props(color=colors[row - 1], fontweight="bold")


def _draw_cross_section(
    axes: Axes, arm: ArmSpec, letter: str, numbers: list[int]
) -> None:
    """Draw a section seen from the tip: x to the right, y up; number its cables.

    The body has its stated radius, to the scale of the cables, and is shown whole.
    """
    first = numbers[0] - 1
    module = arm.modules[first]
    color = module_colors(arm.module_count)[first]
    body = module.radius / module.cable_radius
    size = max(body, 1.22)
    axes.set_xlim(-1.72 * size, 1.72 * size)
    axes.set_ylim(-1.56 * size, 1.56 * size)
    axes.set_aspect("equal")
    fill = {"facecolor": color + "1f", "edgecolor": color, "linewidth": 1.4}
    axes.add_patch(Circle((0, 0), body or size, **fill))
    dashes = {"edgecolor": MUTED, "linewidth": 0.8, "linestyle": "--"}
    axes.add_patch(Circle((0, 0), 1, facecolor="none", **dashes))
    for name, end in zip("xy", np.eye(2), strict=True):
        draw_arrow(axes, (0.0, 0.0), 0.5 * end, MUTED, 0.9, head=8.0)
        _write(axes, 0.65 * end, name, 8)
    white = {"color": "white", "va": "center_baseline", "fontweight": "bold"}
    for number, angle in enumerate(module.cable_angles_deg, start=1):
        place = directions_at(np.deg2rad(angle))
        axes.plot(*place, "o", color=color, markersize=13, mec="white")
        _write(axes, place, str(number), 7.5, **white)
        _write(axes, 1.33 * size * place, f"{angle:g}°", 8, color=INK)
    title = f"section {letter}\ncables at {1000 * module.cable_radius:.4g} mm"
    axes.set_title(title, loc="left", fontsize=9, color=INK)
