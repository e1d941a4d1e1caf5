"""Cross-sections of modules: where the cables run."""

from dataclasses import dataclass
from string import ascii_uppercase
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from s2c2a.arm import ArmSpec, Module
from s2c2a.viz.chart_style import draw_arrow
from s2c2a.viz.colours import INK, MUTED, module_colours

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


def draw_cross_section(axes: Axes, kind: Kind) -> None:
    """Draw a section seen from the tip towards the base: x to the right, y up, cables numbered from 1."""
    axes.set(xlim=(-2.1, 2.1), ylim=(-1.95, 2.85), aspect="equal")
    axes.set_axis_off()
    axes.add_patch(Circle((0, 0), BODY, facecolor=kind.colour + "1f", edgecolor=kind.colour, linewidth=1.4))
    axes.add_patch(Circle((0, 0), 1, facecolor="none", edgecolor=MUTED, linewidth=0.8, linestyle=(0, (3, 3))))
    for end, name in (((0.5, 0.0), "x"), ((0.0, 0.5), "y")):
        draw_arrow(axes, (0.0, 0.0), end, MUTED, 0.9, head=8.0)
        axes.text(1.3 * end[0], 1.3 * end[1], name, fontsize=8, color=MUTED, ha="center", va="center")
    for number, angle in enumerate(kind.module.cable_angles_deg, start=1):
        _draw_cable(axes, number, angle, kind.colour)
    _write_title(axes, kind)


def _draw_cable(axes: Axes, number: int, angle_deg: float, colour: str) -> None:
    """A numbered disc on the circle of the cables, its angle outside of the body."""
    x, y = np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))
    axes.plot(x, y, "o", color=colour, markersize=13, markeredgecolor="white", markeredgewidth=1)
    style: dict[str, Any] = {"fontweight": "bold", "color": "white", "ha": "center", "va": "center_baseline"}
    axes.text(x, y, str(number), fontsize=7.5, **style)
    axes.text(1.62 * x, 1.62 * y, f"{angle_deg:g}°", fontsize=8, color=INK, ha="center", va="center")


def _write_title(axes: Axes, kind: Kind) -> None:
    word = "module" if len(kind.numbers) == 1 else "modules"
    radius = f"cables at {1000 * kind.module.cable_radius:.4g} mm"
    axes.text(-2.05, 2.55, kind.letter, fontsize=12, fontweight="bold", color=INK)
    axes.text(-1.68, 2.55, f"{word} {_ranges(kind.numbers)}", fontsize=9, color=INK)
    axes.text(-1.68, 2.22, radius, fontsize=8.5, color=MUTED)


def _ranges(numbers: tuple[int, ...]) -> str:
    """Numbers as a list of ranges, such as "1–3, 5"; only the first and last ones where that is long."""
    spans: list[list[int]] = []
    for number in numbers:
        if spans and number == spans[-1][1] + 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    words = [str(low) if low == high else f"{low}–{high}" for low, high in spans]
    return ", ".join(words if len(words) < 6 else [*words[:3], "…", words[-1]])
