"""Make the wiring diagram of docs/guides/hardware.md.

Run `python tools/make_wiring.py`.
"""

from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
from matplotlib.patches import Circle, FancyBboxPatch

FILE = Path(__file__).parents[1] / "docs" / "pictures" / "wiring.svg"
POWER = "#c0392b"
GROUND = "#222222"
DATA = "#1f6fb2"
USB = "#5f6f7f"
CABLE = "#8a6d1f"
MODULE_COLORS = ("#dce9f7", "#dff2e1", "#f8e0dc")
WIRES = {POWER: 0.16, DATA: 0.0, GROUND: -0.16}
"""Height of each wire of a servo cable above its middle, by color."""
SERVO = (1.5, 1.0)
SERVO_X = (8.3, 11.1, 13.9)
MODULE_Y = (7.4, 4.4, 1.4)
BUS_X = 6.7


def draw_box(axes, x, y, width, height, text, color="white") -> None:
    """Draw a device with its name in the middle."""
    shape = FancyBboxPatch(
        (x, y), width, height, "round,pad=0,rounding_size=0.1", fc=color, ec="#333333"
    )
    axes.add_patch(shape)
    axes.text(x + width / 2, y + height / 2, text, ha="center", va="center")


def draw_servo_cable(axes, start, end, y) -> None:
    """Draw the three wires of a servo cable, at one height."""
    for color, offset in WIRES.items():
        axes.plot((start, end), (y + offset, y + offset), color=color, lw=1.8)


def draw_branch(axes, module, y) -> None:
    """Draw the cable from the hub to the first servo of a module."""
    middle = y + SERVO[1] / 2
    hub = 4.9 + 0.45 * (1 - module)
    for color, offset in WIRES.items():
        # wires that turn must not cross each other
        turn = BUS_X - offset * (1 - module)
        heights = (hub + offset, hub + offset, middle + offset)
        xs = (5.5, turn, turn, SERVO_X[0])
        axes.plot(xs, (*heights, middle + offset), color=color, lw=1.8)


def draw_winch(axes, x, y, number) -> None:
    """Draw the pulley of a servo and the cable that it winds."""
    center = (x + 0.35, y - 0.42)
    axes.add_patch(Circle(center, 0.27, fc="#eeeeee", ec="#333333"))
    axes.add_patch(Circle(center, 0.04, fc="#333333"))
    rim = center[0] + 0.27
    axes.plot((rim, rim), (center[1], center[1] - 0.75), color=CABLE, lw=2.2)
    axes.text(rim + 0.1, center[1] - 0.62, f"cable {number + 1}", color=CABLE)


def draw_module(axes, module, y) -> None:
    """Draw the three servos of a module and the cables between them."""
    shape = FancyBboxPatch(
        (8.0, y - 1.3), 8.0, 2.75, "round,pad=0,rounding_size=0.15",
        fc=MODULE_COLORS[module], ec="none", zorder=0,
    )  # fmt: skip
    axes.add_patch(shape)
    axes.text(15.9, y + 1.15, f"module {module + 1}", ha="right", weight="bold")
    draw_branch(axes, module, y)
    middle = y + SERVO[1] / 2
    for number, x in enumerate(SERVO_X):
        if number:
            draw_servo_cable(axes, SERVO_X[number - 1] + SERVO[0], x, middle)
        draw_box(axes, x, y, *SERVO, f"servo\nid {3 * module + number + 1}")
        draw_winch(axes, x, y, number)


def draw_supply(axes) -> None:
    """Draw supply, emergency switch, and the two wires to the hub."""
    draw_box(axes, 0.2, 1.2, 2.2, 1.2, "supply\n5 V, 10 A")
    draw_box(axes, 3.3, 1.9, 2.0, 1.1, "emergency\nswitch", "#f9d5d0")
    axes.plot((2.4, 3.3), (2.2, 2.2), color=POWER, lw=2.6)
    axes.plot((4.0, 4.0), (3.0, 4.1), color=POWER, lw=2.6)
    axes.plot(
        (2.4, 5.9, 5.9, 5.0, 5.0), (1.4, 1.4, 3.6, 3.6, 4.1), color=GROUND, lw=2.6
    )
    axes.text(2.45, 2.32, "+5 V", color=POWER)
    axes.text(2.45, 1.1, "ground, not switched", color=GROUND)


def draw_computer(axes) -> None:
    """Draw computer and adapter; the adapter carries no power to the servos."""
    draw_box(axes, 0.2, 7.3, 2.2, 1.2, "computer")
    draw_box(axes, 3.5, 7.3, 2.0, 1.2, "U2D2\nadapter", "#eef2f6")
    axes.plot((2.4, 3.5), (7.9, 7.9), color=USB, lw=3)
    axes.text(2.95, 8.05, "USB", ha="center", color=USB)
    axes.plot((4.3, 4.3), (7.3, 5.7), color=DATA, lw=1.8)
    axes.plot((4.7, 4.7), (7.3, 5.7), color=GROUND, lw=1.8)
    axes.text(4.2, 6.4, "data", ha="right", color=DATA)
    axes.text(4.8, 6.4, "ground", color=GROUND)


def draw_legend(axes) -> None:
    """Name the wires of a servo cable."""
    names = {"+5 V": POWER, "data (TTL, half duplex)": DATA, "ground": GROUND}
    for number, (name, color) in enumerate(names.items()):
        y = 9.35 - 0.35 * number
        axes.plot((0.3, 0.9), (y, y), color=color, lw=1.8)
        axes.text(1.05, y, name, va="center")
    text = "pulley, diameter 20 mm, on each servo; its cable leads into the arm"
    axes.text(8.0, 9.35, text, va="center", color=CABLE)


def main() -> None:
    """Draw everything and save it as SVG, the same at every run."""
    mpl.rcParams.update({"font.size": 10, "svg.hashsalt": "wiring"})
    figure, axes = plt.subplots(figsize=(11.5, 7.2))
    axes.set(xlim=(0, 16.1), ylim=(0, 9.7), aspect="equal")
    axes.axis("off")
    draw_legend(axes)
    draw_computer(axes)
    draw_supply(axes)
    draw_box(axes, 3.5, 4.1, 2.0, 1.6, "power hub", "#fff4d6")
    for module, y in enumerate(MODULE_Y):
        draw_module(axes, module, y)
    figure.savefig(
        FILE, bbox_inches="tight", facecolor="white", metadata={"Date": None}
    )


if __name__ == "__main__":
    main()
