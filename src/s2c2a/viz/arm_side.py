"""The straight arm from the side, to scale."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from s2c2a.arm import ArmSpec, Module
from s2c2a.viz.colours import INK, MUTED, module_colours

DISC_WIDTH = 1.15  # share of the cable radius
END_ROOM = 0.3  # inches kept free above and below the arm
TICK_GAP = 0.16  # inches; boundaries closer than this share a number


@dataclass(frozen=True)
class SideScale:
    """What part of the x-z plane [m] the side view shows, at equal scale in both directions.

    Attributes:
        per_inch: metres in an inch of paper.
        half_width: x shown on either side of the centre line [m].
        low: least z shown [m].
        high: largest z shown [m].
    """

    per_inch: float
    half_width: float
    low: float
    high: float

    @classmethod
    def of(cls, arm: ArmSpec, width: float, height: float) -> "SideScale":
        """The largest scale at which the arm fits width and height [inches]."""
        per_inch = max(arm.length / (height - END_ROOM), _per_inch_across(arm, width))
        spare = per_inch * height - arm.length
        return cls(per_inch, per_inch * width / 2, -0.6 * spare, arm.length + 0.4 * spare)

    def share(self, z):
        """Height of z [m] as a share of the axes' height."""
        return (z - self.low) / (self.high - self.low)


def _per_inch_across(arm: ArmSpec, width: float) -> float:
    """Metres in an inch at which the widest module has room for its numbers on either side."""
    return 4.6 * max(module.cable_radius for module in arm.modules) / width


def fitting_height(arm: ArmSpec, width: float, most: float) -> float:
    """Height [inches] that the arm fills at the given width, a short thick arm less than a slender one."""
    return min(most, max(1.6, arm.length / _per_inch_across(arm, width) + END_ROOM))


def module_ends(arm: ArmSpec) -> np.ndarray:
    """Boundaries of the modules [m], from base to tip, shape (modules + 1,)."""
    return np.concatenate([[0.0], np.cumsum([module.length for module in arm.modules])])


def draw_side(axes: Axes, arm: ArmSpec, scale: SideScale) -> None:
    """Draw the straight arm in the x-z plane with its cables, and number its boundaries [mm]."""
    axes.set(xlim=(-scale.half_width, scale.half_width), ylim=(scale.low, scale.high))
    ends = module_ends(arm)
    for module, bottom, colour in zip(arm.modules, ends, module_colours(arm.module_count), strict=False):
        _draw_module(axes, module, bottom, colour)
    foot = 1.7 * arm.modules[0].cable_radius
    axes.add_patch(Rectangle((-foot, -0.09 * scale.per_inch), 2 * foot, 0.09 * scale.per_inch, color="#7d8795"))
    _number_boundaries(axes, ends, scale)


def _draw_module(axes: Axes, module: Module, bottom: float, colour: str) -> None:
    """Body as wide as the circle of its cables, cables as lines, the end as a plate."""
    radius, top = module.cable_radius, bottom + module.length
    axes.add_patch(Rectangle((-radius, bottom), 2 * radius, module.length, facecolor=colour + "38", edgecolor="none"))
    for angle in np.deg2rad(module.cable_angles_deg):
        axes.plot([radius * np.cos(angle)] * 2, [bottom, top], color=colour, linewidth=1.2)
    plate = [-DISC_WIDTH * radius, DISC_WIDTH * radius]
    axes.plot(plate, [top, top], color=INK, linewidth=1.8, solid_capstyle="butt")


def _number_boundaries(axes: Axes, ends: np.ndarray, scale: SideScale) -> None:
    """Heights above the base at the left edge; where they would touch, the inner ones are left out."""
    left, shown = -0.98 * scale.half_width, [ends[-1]]
    for end in ends[-2::-1]:
        clear = (shown[-1] - end) / scale.per_inch > TICK_GAP
        if clear and (end == 0 or end / scale.per_inch > TICK_GAP):
            shown.append(end)
    for end in shown:
        axes.text(left, end, f"{1000 * end:.4g}", ha="right", va="center", fontsize=8, color=MUTED)
    for end in ends:
        axes.plot([left + 0.06 * scale.per_inch, left + 0.16 * scale.per_inch], [end, end], color=MUTED, linewidth=0.8)
    axes.text(left, scale.high + 0.08 * scale.per_inch, "z [mm]", ha="right", fontsize=8, color=INK)
