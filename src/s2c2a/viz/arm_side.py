"""The straight arm from the side, to scale and as it is mounted, and which way gravity points beside it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from s2c2a.arm import ArmSpec
from s2c2a.viz.charts import draw_arrow
from s2c2a.viz.colours import INK, MUTED, module_colours
from s2c2a.viz.mounting import SIDE, Mounting

DISC_WIDTH = 1.15  # share of the cable radius
BASE_WIDTH, BASE_HEIGHT = 1.7, 0.09  # share of the cable radius, inches
END_ROOM = 0.3  # inches kept free at both ends of the arm together
ROOM_ACROSS = 4.6  # cable radii, for the arm and the numbers beside it
TICK_GAP = 0.16, 0.32  # inches below and beside each other; boundaries closer than this share a number
SIDE_WIDTH = 2.9  # inches, of the drawing
ARROW = -0.45, 0.4  # where gravity's arrow starts beside the frame's axes


@dataclass(frozen=True, eq=False)
class SideView:
    """Where points of the plane of the paper are on it [inches].

    Attributes:
        side: which axis of the base frame runs across the arm, 0 for x, 1 for y.
        ways: across and along the arm on paper, as columns of signs.
        per_inch: metres in an inch.
        origin: where the base is.
    """

    side: int
    ways: Float[np.ndarray, "2 2"]
    per_inch: float
    origin: Float[np.ndarray, "2"]

    @classmethod
    def of(cls, arm: ArmSpec, height: float) -> "SideView":
        """The largest scale at which the arm fits into the middle of the drawing, so many inches high."""
        drawn, room = drawn_axes(Mounting.of(arm)), np.array([SIDE_WIDTH, height])
        side, along = int(np.argmax(np.abs(drawn[:, :2]).sum(axis=0))), np.abs(drawn[:, 2])
        per_inch = max(arm.length / (room @ along - END_ROOM), _across(arm) / (room @ (1 - along)))
        return cls(side, drawn[:, [side, 2]], per_inch, (room - drawn[:, 2] * arm.length / per_inch) / 2)

    @property
    def upright(self) -> bool:
        """Whether the arm runs up or down the paper."""
        return bool(self.ways[1, 1])

    def at(self, z, across=0.0) -> Float[np.ndarray, "*batch 2"]:
        """Places of points by their height above the base and their place across it [m]."""
        points = np.stack(np.broadcast_arrays(across, z), axis=-1)
        return self.origin + points @ self.ways.T / self.per_inch


def drawn_axes(mounting: Mounting) -> Float[np.ndarray, "2 3"]:
    """The base frame's axes as a drawing from the side shows them, to the right and upward; one is not seen."""
    axes, backward = mounting.flat(SIDE)
    return np.eye(3)[list(axes)] * np.where(backward, -1.0, 1.0)[:, None]


def _across(arm: ArmSpec) -> float:
    """Metres that the widest module and its numbers need across."""
    return ROOM_ACROSS * max(module.cable_radius for module in arm.modules)


def fitting_height(arm: ArmSpec, most: float) -> float:
    """Height [inches] that the arm fills, a short thick arm less than a slender one."""
    along = arm.length * SIDE_WIDTH / _across(arm) + END_ROOM if drawn_axes(Mounting.of(arm))[1, 2] else 0.0
    return min(most, max(1.6, along))


def module_ends(arm: ArmSpec) -> Float[np.ndarray, " ends"]:
    """Boundaries of the modules [m], from base to tip, shape (modules + 1,)."""
    return np.concatenate([[0.0], np.cumsum([module.length for module in arm.modules])])


def draw_side(axes: Axes, arm: ArmSpec, view: SideView) -> None:
    """Draw the straight arm with its cables, and number its boundaries [mm]."""
    ends = module_ends(arm)
    for module, low, high, colour in zip(arm.modules, ends, ends[1:], module_colours(arm.module_count), strict=False):
        radius, quarter = module.cable_radius, 90.0 * view.side
        _box(axes, view, (low, high), radius, colour + "38")
        for angle in np.deg2rad(np.subtract(module.cable_angles_deg, quarter)):
            axes.plot(*view.at([low, high], radius * np.cos(angle)).T, color=colour, linewidth=1.2)
        plate = view.at(high, DISC_WIDTH * radius * np.array([-1, 1]))
        axes.plot(*plate.T, color=INK, linewidth=1.8, solid_capstyle="butt")
    _box(axes, view, (-BASE_HEIGHT * view.per_inch, 0.0), BASE_WIDTH * arm.modules[0].cable_radius, "#7d8795")
    _number_boundaries(axes, ends, view, beside=_across(arm) / view.per_inch / 2)


def _box(axes: Axes, view: SideView, heights: tuple[float, float], half: float, colour: str) -> None:
    corners = view.at(np.repeat(heights, 2), half * np.array([-1, 1, 1, -1]))
    axes.add_patch(Polygon(corners, facecolor=colour, edgecolor="none"))


def _number_boundaries(axes: Axes, ends: np.ndarray, view: SideView, beside: float) -> None:
    """Heights above the base, below a lying arm; where they would touch, the inner ones are left out."""
    gap, shown = view.per_inch * TICK_GAP[not view.upright], [ends[-1]]
    for end in ends[-2::-1]:
        if shown[-1] - end > gap and (end == 0 or end > gap):
            shown.append(end)
    away = np.array([-0.49 * SIDE_WIDTH, 0.0] if view.upright else [0.0, -beside])
    ha, va = ("right", "center") if view.upright else ("center", "top")
    beyond = ends[-1] + (0.28 if view.upright else 0.5) * view.per_inch
    for end, text in [*((end, f"{1000 * end:.4g}") for end in shown), (beyond, "z [mm]")]:
        x, y = view.at(end) + away
        axes.text(x, y, text, fontsize=8, color=MUTED, ha=ha, va=va)
    for end in ends:
        tick = view.at(end) + away - np.outer([0.06, 0.16], np.sign(away))
        axes.plot(*tick.T, color=MUTED, linewidth=0.8)


def draw_gravity(axes: Axes, mounting: Mounting) -> None:
    """Draw gravity beside the base frame's axes as they are seen from the side, and how the arm is mounted in words."""
    axes.set(xlim=(-1, 1), ylim=(-1, 1), aspect="equal")
    drawn = drawn_axes(mounting)
    for name, end in zip("xyz", drawn.T, strict=True):
        if end.any():
            draw_arrow(axes, (0.0, 0.0), 0.38 * end, MUTED, 0.8, head=0.0)
            axes.text(0.51 * end[0], 0.51 * end[1], name, fontsize=7.5, color=MUTED, ha="center", va="center")
    if mounting.gravity.any():
        draw_arrow(axes, ARROW, ARROW + 0.8 * drawn @ mounting.gravity, INK, 2.2, head=15.0)
    words = f"gravity\nthe arm {mounting.word}" if mounting.gravity.any() else "no gravity"
    axes.text(-0.95, 0, words, fontsize=8.5, color=INK, ha="right", va="center", linespacing=1.3)
