"""A drawing of an arm: side view to scale, table of modules, gravity, a cross-section for each kind of module.

The side view shows the straight arm as it is mounted, and which way gravity points
beside it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from string import ascii_uppercase
from textwrap import shorten

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from s2c2a.arm import ArmSpec, Module
from s2c2a.viz.charts import draw_arrow, save_figure
from s2c2a.viz.colors import FAINT, INK, MUTED, module_colors
from s2c2a.viz.mounting import SIDE, Mounting

DISC_WIDTH = 1.15  # share of the cable radius
# share of the cable radius, inches
BASE_WIDTH = 1.7
BASE_HEIGHT = 0.09
END_ROOM = 0.3  # inches kept free at both ends of the arm together
ROOM_ACROSS = 4.6  # cable radii, for the arm and the numbers beside it
# inches below and beside each other; boundaries closer than this share a number
TICK_GAP = 0.16, 0.32
SIDE_WIDTH = 2.9  # inches, of the drawing
ARROW = -0.45, 0.4  # where gravity's arrow starts beside the frame's axes
LONGEST = 104  # letters of a description
# inches
WIDTH = 11.0
HEADING = 1.65
MARGIN = 0.2
SIDE_LEFT = 0.95
TABLE_WIDTH = 6.7
SIDE_HEIGHT = 4.2
ROW_HEIGHT = 0.27
SECTIONS_IN_A_ROW = 4
SECTION_HEIGHT = 2.85
# left edge of the first column, inches from the left of the side view, as the next ones
COLUMNS = SIDE_WIDTH + 0.9
ROW_GAP = 0.24  # inches
# right edges of the first and the last column
NUMBER = SIDE_WIDTH + 1.55
SECTION = SIDE_WIDTH + 6.6
QUANTITIES: dict[str, tuple[float, Callable[[Module], float]]] = {
    "length\n[mm]": (SIDE_WIDTH + 2.2, lambda module: 1000 * module.length),
    "cables at\n[mm]": (SIDE_WIDTH + 2.95, lambda module: 1000 * module.cable_radius),
    "mass\n[g]": (SIDE_WIDTH + 3.6, lambda module: 1000 * module.mass),
    "EI\n[N m²]": (SIDE_WIDTH + 4.35, lambda module: module.bending_stiffness),
    "GJ\n[N m²]": (SIDE_WIDTH + 5.1, lambda module: module.gj),
    "bend limit\n[deg]": (SIDE_WIDTH + 5.9, lambda module: module.bend_limit_deg),
}
# radius of the body drawn, as a share of the cable radius; an arm file does not state
# it
BODY = 1.22


@dataclass(frozen=True, eq=False)
class SideView:
    """Where points of the plane of the paper are on it [inches].

    Attributes:
        side: which axis of the base frame runs across the arm, 0 for x, 1 for y.
        ways: across and along the arm on paper, as columns of signs.
        per_inch: meters in an inch.
        origin: where the base is.
    """

    side: int
    ways: Float[np.ndarray, "2 2"]
    per_inch: float
    origin: Float[np.ndarray, "2"]

    @classmethod
    def of(cls, arm: ArmSpec, height: float) -> "SideView":
        """The largest scale at which the arm fits into the middle of the drawing, so many inches high."""
        drawn = _drawn_axes(Mounting.of(arm))
        room = np.array([SIDE_WIDTH, height])
        side = int(np.argmax(np.abs(drawn[:, :2]).sum(axis=0)))
        along = np.abs(drawn[:, 2])
        per_inch = max(
            arm.length / (room @ along - END_ROOM), _across(arm) / (room @ (1 - along))
        )
        return cls(
            side,
            drawn[:, [side, 2]],
            per_inch,
            (room - drawn[:, 2] * arm.length / per_inch) / 2,
        )

    @property
    def upright(self) -> bool:
        """Whether the arm runs up or down the paper."""
        return bool(self.ways[1, 1])

    def at(self, z, across=0.0) -> Float[np.ndarray, "*batch 2"]:
        """Places of points by their height above the base and their place across it [m]."""
        return (
            self.origin
            + np.stack(np.broadcast_arrays(across, z), axis=-1)
            @ self.ways.T
            / self.per_inch
        )


def kinds_of_module(arm: ArmSpec) -> dict[str, list[int]]:
    """Numbers of the modules, from 1 at the base, whose cables run alike, by a letter: "A" for those nearest to it."""
    groups: dict[tuple, list[int]] = {}
    for number, module in enumerate(arm.modules, start=1):
        groups.setdefault((module.cable_radius, module.cable_angles_deg), []).append(
            number
        )
    return dict(zip(ascii_uppercase, groups.values(), strict=False))


def arm_figure(arm: ArmSpec, path: str | Path) -> Path:
    """Draw the straight arm as it is mounted, from the side and to scale, its modules, cables and gravity.

    Args:
        arm: the arm.
        path: file to write, ending in .png, .pdf or .svg; replaced if it exists.

    Raises:
        S2C2AError: the name ends in another format, or the file cannot be written.
    """
    kinds = kinds_of_module(arm)
    along = (
        arm.length * SIDE_WIDTH / _across(arm) + END_ROOM
        if _drawn_axes(Mounting.of(arm))[1, 2]
        else 0.0
    )
    side_height = max(min(SIDE_HEIGHT, max(1.6, along)), ROW_HEIGHT * arm.module_count)
    sections_height = SECTION_HEIGHT * -(-len(kinds) // SECTIONS_IN_A_ROW)
    height = HEADING + side_height + 2 * MARGIN + sections_height
    figure = Figure(figsize=(WIDTH, height), facecolor="white")
    _write_heading(figure, arm)
    _draw_gravity(_axes(figure, WIDTH - 1.3, 0.12, 1.0, 1.0), Mounting.of(arm))
    view = SideView.of(arm, side_height)
    axes = _axes(figure, SIDE_LEFT, HEADING, SIDE_WIDTH + TABLE_WIDTH, side_height)
    axes.set(xlim=(0, SIDE_WIDTH + TABLE_WIDTH), ylim=(0, side_height))
    _draw_side(axes, arm, view)
    _draw_table(axes, arm, kinds, view, side_height)
    for place, (letter, numbers) in enumerate(kinds.items()):
        row, column = divmod(place, SECTIONS_IN_A_ROW)
        left = 0.3 + column * (WIDTH - 0.4) / SECTIONS_IN_A_ROW
        top = height - sections_height + row * SECTION_HEIGHT
        _draw_cross_section(
            _axes(figure, left, top, 2.45, SECTION_HEIGHT - 0.15), arm, letter, numbers
        )
    return save_figure(figure, path)


def _axes(figure: Figure, left: float, top: float, width: float, height: float) -> Axes:
    """Bare axes at a place in inches from the upper left corner."""
    page = np.tile(figure.get_size_inches(), 2)
    axes = figure.add_axes(
        tuple(np.array([left, page[1] - top - height, width, height]) / page)
    )
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
        (
            f"{whole}  ·  actuated by {arm.actuation}  ·  {arm.control_rate:.4g} Hz",
            9,
            "normal",
            MUTED,
        ),
    ]
    for row, (text, size, weight, color) in enumerate(
        line for line in lines if line[0]
    ):
        place = 1 - (0.42 + 0.27 * row) / figure.get_figheight()
        figure.text(
            0.4 / WIDTH,
            place,
            text,
            fontsize=size,
            fontweight=weight,
            color=color,
            parse_math=False,
        )


def _draw_table(
    axes: Axes, arm: ArmSpec, kinds: dict[str, list[int]], view: SideView, height: float
) -> None:
    """Write a row for each module; beside an arm that stands or hangs, tied to the module by a line.

    Args:
        axes: bare axes in inches that hold the side view too.
        arm: the arm.
        kinds: its cross-sections.
        view: its side view.
        height: of the table [inches].
    """
    headings = {
        "module": NUMBER,
        **{name: right for name, (right, _) in QUANTITIES.items()},
        "section": SECTION,
    }
    for name, right in headings.items():
        axes.text(
            right,
            height + 0.1,
            name,
            fontsize=8,
            color=MUTED,
            ha="right",
            va="bottom",
            linespacing=1.25,
        )
    axes.plot(
        [COLUMNS, SIDE_WIDTH + TABLE_WIDTH],
        [height + 0.04] * 2,
        color=FAINT,
        linewidth=1,
        clip_on=False,
    )
    letters = {
        number: letter for letter, numbers in kinds.items() for number in numbers
    }
    middles = view.at((_module_ends(arm)[:-1] + _module_ends(arm)[1:]) / 2)[:, 1]
    order = (
        np.argsort(middles, kind="stable")
        if view.upright
        else np.arange(arm.module_count)[::-1]
    )
    rows = np.empty(arm.module_count)
    rows[order] = spread(middles[order], ROW_GAP, height)
    for place, (module, color) in enumerate(
        zip(arm.modules, module_colors(arm.module_count), strict=True)
    ):
        axes.plot(COLUMNS + 0.05, rows[place], "o", color=color, markersize=4)
        if view.upright:
            edge = (
                view.origin[0] + DISC_WIDTH * module.cable_radius / view.per_inch + 0.08
            )
            x = [edge, SIDE_WIDTH + 0.15, COLUMNS - 0.2, COLUMNS + 0.05]
            axes.plot(
                x,
                [middles[place]] * 2 + [rows[place]] * 2,
                color=color,
                linewidth=0.8,
                alpha=0.8,
            )
        cells = [
            str(place + 1),
            *(f"{quantity(module):.4g}" for _, quantity in QUANTITIES.values()),
            letters[place + 1],
        ]
        for right, text in zip(headings.values(), cells, strict=True):
            axes.text(
                right,
                rows[place],
                text,
                ha="right",
                va="center_baseline",
                fontsize=9,
                color=INK,
            )


def spread(places: np.ndarray, gap: float, height: float = 1.0) -> np.ndarray:
    """Rising places up to a height, moved so that they lie at least `gap` apart and half a gap off the edges."""
    steps = gap * np.arange(len(places))
    upward = np.maximum.accumulate(np.maximum(places - steps, gap / 2)) + steps
    return np.minimum(upward, height - gap / 2 - steps[::-1])


def _draw_cross_section(
    axes: Axes, arm: ArmSpec, letter: str, numbers: list[int]
) -> None:
    """Draw a section seen from the tip towards the base: x to the right, y up, cables numbered from 1."""
    axes.set(xlim=(-2.1, 2.1), ylim=(-1.95, 2.85), aspect="equal")
    first = arm.modules[numbers[0] - 1]
    color = module_colors(arm.module_count)[numbers[0] - 1]
    axes.add_patch(
        Circle((0, 0), BODY, facecolor=color + "1f", edgecolor=color, linewidth=1.4)
    )
    axes.add_patch(
        Circle(
            (0, 0),
            1,
            facecolor="none",
            edgecolor=MUTED,
            linewidth=0.8,
            linestyle=(0, (3, 3)),
        )
    )
    for end, name in (((0.5, 0.0), "x"), ((0.0, 0.5), "y")):
        draw_arrow(axes, (0.0, 0.0), end, MUTED, 0.9, head=8.0)
        axes.text(
            1.3 * end[0],
            1.3 * end[1],
            name,
            fontsize=8,
            color=MUTED,
            ha="center",
            va="center",
        )
    for number, angle in enumerate(first.cable_angles_deg, start=1):
        x = np.cos(np.deg2rad(angle))
        y = np.sin(np.deg2rad(angle))
        axes.plot(
            x,
            y,
            "o",
            color=color,
            markersize=13,
            markeredgecolor="white",
            markeredgewidth=1,
        )
        axes.text(
            x,
            y,
            str(number),
            fontsize=7.5,
            fontweight="bold",
            color="white",
            ha="center",
            va="center_baseline",
        )
        axes.text(
            1.62 * x,
            1.62 * y,
            f"{angle:g}°",
            fontsize=8,
            color=INK,
            ha="center",
            va="center",
        )
    word = "module" if len(numbers) == 1 else "modules"
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    spans = [str(run[0]) if len(run) == 1 else f"{run[0]}–{run[-1]}" for run in runs]
    spans = spans if len(spans) < 6 else [*spans[:3], "…", spans[-1]]
    axes.text(-2.05, 2.55, letter, fontsize=12, fontweight="bold", color=INK)
    axes.text(-1.68, 2.55, f"{word} {', '.join(spans)}", fontsize=9, color=INK)
    axes.text(
        -1.68,
        2.22,
        f"cables at {1000 * first.cable_radius:.4g} mm",
        fontsize=8.5,
        color=MUTED,
    )


def _drawn_axes(mounting: Mounting) -> Float[np.ndarray, "2 3"]:
    """The base frame's axes as a drawing from the side shows them, to the right and upward; one is not seen."""
    axes, backward = mounting.flat(SIDE)
    return np.eye(3)[list(axes)] * np.where(backward, -1.0, 1.0)[:, None]


def _across(arm: ArmSpec) -> float:
    """Meters that the widest module and its numbers need across."""
    return ROOM_ACROSS * max(module.cable_radius for module in arm.modules)


def _module_ends(arm: ArmSpec) -> Float[np.ndarray, " ends"]:
    """Boundaries of the modules [m], from base to tip, shape (modules + 1,)."""
    return np.concatenate([[0.0], np.cumsum([module.length for module in arm.modules])])


def _draw_side(axes: Axes, arm: ArmSpec, view: SideView) -> None:
    """Draw the straight arm with its cables, and number its boundaries [mm]."""
    ends = _module_ends(arm)
    for module, low, high, color in zip(
        arm.modules, ends, ends[1:], module_colors(arm.module_count), strict=False
    ):
        radius = module.cable_radius
        quarter = 90.0 * view.side
        _box(axes, view, (low, high), radius, color + "38")
        for angle in np.deg2rad(np.subtract(module.cable_angles_deg, quarter)):
            axes.plot(
                *view.at([low, high], radius * np.cos(angle)).T,
                color=color,
                linewidth=1.2,
            )
        plate = view.at(high, DISC_WIDTH * radius * np.array([-1, 1]))
        axes.plot(*plate.T, color=INK, linewidth=1.8, solid_capstyle="butt")
    _box(
        axes,
        view,
        (-BASE_HEIGHT * view.per_inch, 0.0),
        BASE_WIDTH * arm.modules[0].cable_radius,
        "#7d8795",
    )
    _number_boundaries(axes, ends, view, beside=_across(arm) / view.per_inch / 2)


def _box(
    axes: Axes, view: SideView, heights: tuple[float, float], half: float, color: str
) -> None:
    corners = view.at(np.repeat(heights, 2), half * np.array([-1, 1, 1, -1]))
    axes.add_patch(Polygon(corners, facecolor=color, edgecolor="none"))


def _number_boundaries(
    axes: Axes, ends: np.ndarray, view: SideView, beside: float
) -> None:
    """Heights above the base, below a lying arm; where they would touch, the inner ones are left out."""
    gap = view.per_inch * TICK_GAP[not view.upright]
    shown = [ends[-1]]
    for end in ends[-2::-1]:
        if shown[-1] - end > gap and (end == 0 or end > gap):
            shown.append(end)
    away = np.array([-0.49 * SIDE_WIDTH, 0.0] if view.upright else [0.0, -beside])
    ha, va = ("right", "center") if view.upright else ("center", "top")
    beyond = ends[-1] + (0.28 if view.upright else 0.5) * view.per_inch
    for end, text in [
        *((end, f"{1000 * end:.4g}") for end in shown),
        (beyond, "z [mm]"),
    ]:
        x, y = view.at(end) + away
        axes.text(x, y, text, fontsize=8, color=MUTED, ha=ha, va=va)
    for end in ends:
        axes.plot(
            *(view.at(end) + away - np.outer([0.06, 0.16], np.sign(away))).T,
            color=MUTED,
            linewidth=0.8,
        )


def _draw_gravity(axes: Axes, mounting: Mounting) -> None:
    """Draw gravity beside the base frame's axes as they are seen from the side, and how the arm is mounted in words."""
    axes.set(xlim=(-1, 1), ylim=(-1, 1), aspect="equal")
    drawn = _drawn_axes(mounting)
    for name, end in zip("xyz", drawn.T, strict=True):
        if end.any():
            draw_arrow(axes, (0.0, 0.0), 0.38 * end, MUTED, 0.8, head=0.0)
            axes.text(
                0.51 * end[0],
                0.51 * end[1],
                name,
                fontsize=7.5,
                color=MUTED,
                ha="center",
                va="center",
            )
    if mounting.gravity.any():
        draw_arrow(
            axes, ARROW, ARROW + 0.8 * drawn @ mounting.gravity, INK, 2.2, head=15.0
        )
    words = (
        f"gravity\nthe arm {mounting.word}" if mounting.gravity.any() else "no gravity"
    )
    axes.text(
        -0.95,
        0,
        words,
        fontsize=8.5,
        color=INK,
        ha="right",
        va="center",
        linespacing=1.3,
    )
