"""Make the diagrams of docs/concepts and docs/contribute/architecture.md.

Run `python tools/make_concept_pictures.py`.
"""

from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Arc, FancyBboxPatch

from s2c2a.arm.geometry import center_line
from s2c2a.kinematics import states_from_bends

FOLDER = Path(__file__).parents[1] / "docs" / "pictures"
INK = "#333333"
LIGHT = "#f4f6f8"
STATE = "#1f6fb2"
CONFIGURATION = "#c0392b"
ACTION = "#2e8b57"
SPACE_TINTS = {STATE: "#dce9f7", CONFIGURATION: "#f8e0dc", ACTION: "#dff2e1"}
GRAY = "#8a94a0"
MODULE_LENGTH = 0.2
BENDS = np.array([[1.0, 0.0], [-1.2, 0.0], [0.9, 0.0]])
Point = tuple[float, float]


def blank(width: float, height: float, scale: float = 0.62) -> tuple[plt.Figure, Axes]:
    """Make an empty drawing area without axes; lengths are in its own units."""
    figure, axes = plt.subplots(figsize=(width * scale, height * scale))
    axes.set(xlim=(0, width), ylim=(0, height), aspect="equal")
    axes.axis("off")
    return figure, axes


def save(figure: plt.Figure, name: str) -> None:
    """Save a figure as SVG, the same at every run."""
    figure.savefig(
        FOLDER / f"{name}.svg",
        bbox_inches="tight",
        facecolor="white",
        metadata={"Date": None},
    )
    plt.close(figure)


def draw_box(
    axes: Axes,
    center: Point,
    size: Point,
    text: str,
    color: str = LIGHT,
    edge: str = INK,
) -> None:
    """Draw a box with text in its middle."""
    x = center[0] - size[0] / 2
    y = center[1] - size[1] / 2
    style = "round,pad=0,rounding_size=0.12"
    axes.add_patch(FancyBboxPatch((x, y), *size, style, fc=color, ec=edge, lw=1.3))
    axes.text(*center, text, ha="center", va="center")


def draw_arrow(
    axes: Axes, start: Point, end: Point, color: str = INK, curve: float = 0.0
) -> None:
    """Draw an arrow; `curve` bends it to the right of its direction."""
    properties = {
        "arrowstyle": "-|>",
        "color": color,
        "lw": 1.5,
        "shrinkA": 0,
        "shrinkB": 0,
        "connectionstyle": f"arc3,rad={curve}",
    }
    axes.annotate("", xy=end, xytext=start, arrowprops=properties)


def draw_path(axes: Axes, points: list[Point], color: str = INK) -> None:
    """Draw straight lines through the points, with an arrowhead at the last."""
    xs, ys = zip(*points[:-1], strict=True)
    axes.plot(xs, ys, color=color, lw=1.5, solid_joinstyle="round")
    draw_arrow(axes, points[-2], points[-1], color)


def label(axes: Axes, x: float, y: float, text: str, **options) -> None:
    """Write centered text."""
    axes.text(x, y, text, **{"ha": "center", "va": "center", **options})


# ---- the three spaces


def arm_states() -> np.ndarray:
    """Return the states of the drawn arm, shape (modules, 6), base frame."""
    lengths = np.full(len(BENDS), MODULE_LENGTH)
    return np.asarray(states_from_bends(BENDS, lengths))


def draw_arm(axes: Axes) -> None:
    """Draw the center line, the base and the module ends."""
    states = arm_states()
    lengths = np.full(len(states), MODULE_LENGTH)
    line = np.asarray(center_line(states, lengths, points=20))
    line = np.concatenate([np.zeros((1, 3)), line])
    axes.plot(line[:, 0], line[:, 2], color="#c9d1d9", lw=9, solid_capstyle="round")
    axes.plot((-0.07, 0.07), (0.0, 0.0), color=INK, lw=4)


def module_frames() -> list[tuple[np.ndarray, np.ndarray]]:
    """Return origin and end-axis direction of the base and of every module, x-z."""
    frames = [(np.zeros(2), np.array([0.0, 1.0]))]
    for state in arm_states():
        frames.append((state[[0, 2]], state[[3, 5]]))
    return frames


def draw_state(axes: Axes) -> None:
    """Draw positions and axes of all module ends in the base frame."""
    draw_arm(axes)
    for axis, offset, name in (
        ((0.09, 0.0), (0.03, 0), "x"),
        ((0, 0.09), (0, 0.03), "z"),
    ):
        draw_arrow(axes, (0.0, 0.0), axis, GRAY)
        label(axes, axis[0] + offset[0], axis[1] + offset[1], name, color=GRAY)
    for number, (end, axis) in enumerate(module_frames()[1:], start=1):
        axes.plot(*end, "o", color=STATE, ms=6)
        draw_arrow(axes, tuple(end), tuple(end + 0.13 * axis), STATE)
        side = 1.0 if axis[0] > 0.0 else -1.0
        place = end + np.array([-0.06 * side, 0.015])
        label(axes, *place, f"$p'_{number}$", color=STATE, size=12)
        place = end + 0.13 * axis + np.array([0.04 * side, 0.015])
        label(axes, *place, f"$o'_{number}$", color=STATE, size=12)


def draw_configuration(axes: Axes) -> None:
    """Draw the end axis of every module in the frame of its own base."""
    draw_arm(axes)
    frames = module_frames()
    for number in range(1, len(frames)):
        base_axis = frames[number - 1][1]
        end, axis = frames[number]
        straight = end + 0.15 * base_axis
        axes.plot(
            (end[0], straight[0]), (end[1], straight[1]), color=GRAY, lw=1.2, ls="--"
        )
        draw_arrow(axes, tuple(end), tuple(end + 0.15 * axis), CONFIGURATION)
        angles = [np.rad2deg(np.arctan2(v[1], v[0])) for v in (base_axis, axis)]
        axes.add_patch(
            Arc(end, 0.15, 0.15, theta1=min(angles), theta2=max(angles), color=INK)
        )
        middle = (base_axis + axis) / np.linalg.norm(base_axis + axis)
        label(axes, *(end + 0.115 * middle), rf"$\varphi_{number}$", size=11)
        outward = axis - 0.9 * base_axis
        place = end + 0.15 * axis + 0.045 * outward / np.linalg.norm(outward)
        label(axes, *place, f"$o_{number}$", color=CONFIGURATION, size=12)


def draw_action(axes: Axes) -> None:
    """Draw the cables of one bent module and its cross-section."""
    bend = 0.9
    radius = 0.09
    length = 0.34
    along = np.linspace(0.0, 1.0, 40)
    for side, color, name in (
        (1.0, ACTION, "pulled: $a<0$"),
        (-1.0, GRAY, "released: $a>0$"),
    ):
        angles = bend * along
        arc = length / bend
        xs = arc * (1.0 - np.cos(angles)) + side * radius * np.cos(angles)
        ys = 0.08 + arc * np.sin(angles) - side * radius * np.sin(angles)
        axes.plot(xs, ys, color=color, lw=2.2)
        axes.plot((side * radius, side * radius), (0.08, -0.03), color=color, lw=2.2)
        if side > 0:
            draw_arrow(axes, (side * radius, 0.02), (side * radius, -0.06), color)
        label(axes, side * 0.17, -0.10, name, color=color, size=9)
    xs = length / bend * (1.0 - np.cos(bend * along))
    ys = 0.08 + length / bend * np.sin(bend * along)
    axes.plot(xs, ys, color="#c9d1d9", lw=9, solid_capstyle="round", zorder=0)
    axes.plot((-0.13, 0.13), (0.08, 0.08), color=INK, lw=3)
    draw_cross_section(axes, (-0.12, 0.52))


def draw_cross_section(axes: Axes, center: Point) -> None:
    """Draw the three cables around the center line, seen from the tip."""
    radius = 0.09
    axes.add_patch(plt.Circle(center, radius, fc="none", ec=GRAY))
    axes.plot((center[0], center[0] + radius), (center[1],) * 2, color=GRAY, lw=0.9)
    label(axes, center[0] + 0.045, center[1] + 0.025, "$r_p$", color=GRAY, size=9)
    for number, angle in enumerate(np.deg2rad([0.0, 120.0, 240.0]), start=1):
        direction = np.array([np.cos(angle), np.sin(angle)])
        place = np.array(center) + radius * direction
        axes.plot(*place, "o", color=ACTION, ms=6)
        label(axes, *(place + 0.045 * direction), f"$a_{number}$", color=ACTION)


def make_spaces() -> None:
    """Draw one arm in the three spaces, and the maps between them."""
    figure, panels = plt.subplots(1, 3, figsize=(11.0, 5.0))
    parts = (
        ("State S", "where every module ends", STATE, draw_state),
        (
            "Configuration C",
            "how every module bends",
            CONFIGURATION,
            draw_configuration,
        ),
        ("Action A", "what every cable does", ACTION, draw_action),
    )
    for axes, (name, text, color, draw) in zip(panels, parts, strict=True):
        draw(axes)
        axes.set(xlim=(-0.32, 0.38), ylim=(-0.16, 0.76), aspect="equal")
        axes.axis("off")
        axes.set_title(name, color=color, size=14, pad=18)
        axes.text(0.5, 1.02, text, ha="center", transform=axes.transAxes, color=INK)
    figure.subplots_adjust(wspace=0.12, bottom=0.2)
    draw_maps(figure)
    save(figure, "spaces")


def draw_maps(figure: plt.Figure) -> None:
    """Draw the arrows between the spaces below the panels."""
    axes = figure.add_axes((0.0, 0.0, 1.0, 0.2))
    axes.set(xlim=(0, 10), ylim=(0, 2))
    axes.axis("off")
    draw_arrow(axes, (2.4, 1.5), (4.7, 1.5))
    label(axes, 3.55, 1.78, "S2C: planner")
    draw_arrow(axes, (5.4, 1.5), (7.7, 1.5))
    label(axes, 6.55, 1.78, "C2A: controller")
    draw_arrow(axes, (4.7, 0.8), (2.4, 0.8), GRAY)
    label(axes, 3.55, 0.45, "C2S: forward model", color=GRAY)
    draw_arrow(axes, (7.7, 0.8), (5.4, 0.8), GRAY)
    label(axes, 6.55, 0.45, "sensing: encoders, constant curvature", color=GRAY)


# ---- block diagrams


def make_loop() -> None:
    """Draw one control step."""
    figure, axes = blank(19.0, 6.6)
    top = 4.8
    size = (2.8, 1.4)
    places = {
        "planner\nS2C": (5.0, CONFIGURATION),
        "controller\nC2A": (9.3, ACTION),
        "command\nlimits": (13.1, INK),
        "robot": (16.7, INK),
    }
    for text, (x, color) in places.items():
        draw_box(axes, (x, top), size, text, SPACE_TINTS.get(color, LIGHT), color)
    draw_arrow(axes, (0.6, top), (3.6, top))
    label(axes, 2.0, top + 0.62, "goal:\ntargets, obstacles")
    for start, end in ((6.4, 7.9), (10.7, 11.7), (14.5, 15.3)):
        draw_arrow(axes, (start, top), (end, top))
    label(axes, 7.15, top + 0.32, "$C_d$", color=CONFIGURATION, size=12)
    label(axes, 11.2, top + 0.32, "$A$", color=ACTION, size=12)
    label(axes, 14.9, top + 0.32, "$A$", color=ACTION, size=12)
    draw_box(axes, (13.1, 1.4), (3.6, 1.4), "state estimator\npredict, update")
    draw_path(axes, [(16.7, top - 0.7), (16.7, 1.4), (14.9, 1.4)])
    label(axes, 16.85, 2.8, "reading:\nencoders,\nother sensors", ha="left")
    draw_path(axes, [(11.3, 1.4), (9.3, 1.4), (9.3, top - 0.7)])
    draw_path(axes, [(9.3, 1.4), (6.0, 1.4), (6.0, top - 0.7)])
    label(axes, 7.6, 0.95, "sensed $C$, payload,\nbend biases", va="top")
    forward_model = "forward model\nC2S"
    draw_box(axes, (3.6, 1.4), (3.0, 1.4), forward_model, SPACE_TINTS[STATE], STATE)
    draw_arrow(axes, (4.4, 2.1), (4.4, top - 0.7), STATE)
    label(axes, 4.25, 3.1, "predicted $S$", color=STATE, ha="right")
    save(figure, "loop")


def make_filter() -> None:
    """Draw one step of the state estimator."""
    figure, axes = blank(19.4, 6.4)
    size = (3.8, 1.5)
    draw_box(axes, (2.4, 5.2), size, "encoders\nsensed $C$")
    draw_box(axes, (7.6, 5.2), size, "forward model\nequilibrium bends")
    draw_box(axes, (12.8, 5.2), size, "predict\nmean and covariance")
    draw_box(axes, (12.8, 1.5), size, "update\n$x + K r$", "#dff2e1")
    draw_box(axes, (7.6, 1.5), size, "gate\n$r$ small enough?", "#fff4d6")
    draw_box(axes, (2.4, 1.5), size, "other sensors\nIMU, currents, camera")
    draw_box(
        axes, (17.3, 3.35), (2.8, 1.7), "estimate\npayload,\nbend biases", "#dce9f7"
    )
    draw_arrow(axes, (4.3, 5.2), (5.7, 5.2))
    draw_arrow(axes, (9.5, 5.2), (10.9, 5.2))
    draw_arrow(axes, (4.3, 1.5), (5.7, 1.5))
    draw_arrow(axes, (9.5, 1.5), (10.9, 1.5))
    label(axes, 10.2, 1.8, "yes")
    draw_path(axes, [(7.6, 0.75), (7.6, 0.2), (8.5, 0.2)])
    label(axes, 8.65, 0.2, "no: the sensor is rejected for 0.5 s", ha="left")
    draw_path(axes, [(12.1, 4.45), (12.1, 3.35), (7.6, 3.35), (7.6, 2.25)])
    label(axes, 9.6, 3.65, "predicted measurement")
    draw_arrow(axes, (13.5, 4.45), (13.5, 2.25))
    draw_path(axes, [(14.7, 1.5), (17.3, 1.5), (17.3, 2.5)])
    draw_path(axes, [(17.3, 4.2), (17.3, 5.2), (14.7, 5.2)])
    label(axes, 16.1, 5.5, "next step")
    save(figure, "filter")


def make_forward_model() -> None:
    """Draw the structure of the forward model of `best`."""
    figure, axes = blank(19.6, 6.6)
    top = 4.9
    boxes = (
        (3.7, "cable\ntransmission", "backlash, creep"),
        (8.0, "static\nequilibrium", "taut and slack cables"),
        (12.3, "chain of arcs", "exact kinematics"),
    )
    for x, text, note in boxes:
        draw_box(axes, (x, top), (2.9, 1.5), text)
        label(axes, x, top + 1.05, note, color=GRAY, size=9)
    draw_arrow(axes, (0.6, top), (2.25, top))
    label(axes, 0.55, top + 0.4, "planned $C$", ha="left", color=CONFIGURATION)
    draw_arrow(axes, (5.15, top), (6.55, top))
    label(axes, 5.85, top + 0.62, "displace-\nments", size=9)
    draw_arrow(axes, (9.45, top), (10.85, top))
    label(axes, 10.15, top + 0.3, "bends", size=9)
    axes.add_patch(plt.Circle((15.4, top), 0.28, fc="white", ec=INK, lw=1.3))
    label(axes, 15.4, top, "+")
    draw_arrow(axes, (13.75, top), (15.12, top))
    draw_arrow(axes, (15.68, top), (18.0, top))
    label(axes, 16.9, top + 0.4, "predicted $S$", color=STATE)
    draw_box(
        axes, (8.0, 1.7), (3.4, 1.3), "residual network\n2 layers of 64", "#dff2e1"
    )
    draw_arrow(axes, (7.4, top - 0.75), (7.4, 2.35), GRAY)
    draw_arrow(axes, (8.6, 2.35), (8.6, top - 0.75))
    label(axes, 8.75, 3.3, "moments", ha="left", size=9)
    draw_path(axes, [(9.7, 1.7), (12.3, 1.7), (12.3, top - 0.75)])
    label(axes, 12.15, 2.6, "bends,\nend points", ha="right", size=9)
    draw_box(
        axes, (15.4, 1.7), (3.2, 1.3), "local model\n(kernels), optional", "#dce9f7"
    )
    draw_arrow(axes, (15.4, 2.35), (15.4, top - 0.28))
    label(axes, 15.55, 3.3, "near the data", ha="left", size=9)
    draw_arrow(axes, (3.7, 2.35), (3.7, top - 0.75), GRAY)
    label(axes, 3.7, 2.0, "memory of past\nsensed configurations", size=9, color=GRAY)
    save(figure, "forward-model")


def make_planner() -> None:
    """Draw one planning step of `best`."""
    figure, axes = blank(18.4, 6.6)
    top = 4.6
    draw_box(axes, (4.1, top), (2.9, 1.5), "guides\nDetour, Pull")
    draw_box(axes, (8.6, top), (3.3, 1.5), "solver\nleast squares")
    draw_box(axes, (13.1, top), (2.9, 1.5), "step limit,\nbend limits")
    draw_arrow(axes, (0.9, top), (2.65, top))
    label(axes, 0.9, top + 0.35, "goal", ha="left")
    draw_arrow(axes, (5.55, top), (6.95, top))
    label(axes, 6.25, top + 0.62, "nearer\ngoal", size=9)
    draw_arrow(axes, (10.25, top), (11.65, top))
    draw_arrow(axes, (14.55, top), (17.2, top))
    label(axes, 17.0, top + 0.35, "plan $C_d$", color=CONFIGURATION)
    draw_box(
        axes, (8.6, 1.5), (3.3, 1.5), "terms and\nforward model", SPACE_TINTS[STATE]
    )
    draw_arrow(axes, (8.1, top - 0.75), (8.1, 2.25), GRAY)
    draw_arrow(axes, (9.1, 2.25), (9.1, top - 0.75))
    label(axes, 7.95, 3.2, "bends", ha="right", size=9, color=GRAY)
    label(axes, 9.25, 3.2, "residuals, slopes", ha="left", size=9)
    draw_box(axes, (13.1, 1.5), (2.9, 1.5), "fallback search\nif stuck", "#fff4d6")
    draw_arrow(axes, (12.7, top - 0.75), (12.7, 2.25), GRAY)
    draw_arrow(axes, (13.5, 2.25), (13.5, top - 0.75))
    draw_path(axes, [(16.0, top), (16.0, 6.1), (8.6, 6.1), (8.6, top + 0.75)], GRAY)
    label(axes, 12.3, 6.35, "start of the next step", size=9, color=GRAY)
    save(figure, "planner")


def make_stages() -> None:
    """Draw the stages of a controlled arm."""
    figure, axes = blank(17.0, 7.2)
    size = (2.5, 1.1)
    places = {
        "IDLE": (2.0, 5.6),
        "START": (7.2, 5.6),
        "RUN": (13.6, 5.6),
        "HOLD": (13.6, 1.2),
        "RELEASE": (2.0, 1.2),
        "FAULT": (7.2, 3.3),
    }
    tints = {"RUN": "#dff2e1", "HOLD": "#fff4d6", "RELEASE": "#fff4d6"}
    tints["FAULT"] = "#f8e0dc"
    for name, place in places.items():
        draw_box(axes, place, size, name, tints.get(name, LIGHT))
    draw_arrow(axes, (3.25, 5.6), (5.95, 5.6))
    label(axes, 4.6, 5.4, "enabled,\nunsound", size=9, va="top")
    draw_arrow(axes, (8.45, 5.6), (12.35, 5.6))
    label(axes, 10.4, 5.85, "sound reading", size=9)
    draw_path(axes, [(2.0, 6.15), (2.0, 6.9), (13.6, 6.9), (13.6, 6.15)])
    label(axes, 7.8, 6.68, "enabled and sound", size=9)
    draw_arrow(axes, (13.2, 5.05), (13.2, 1.75))
    label(axes, 13.05, 3.4, "disabled\nor unsound", ha="right", size=9)
    draw_arrow(axes, (14.0, 1.75), (14.0, 5.05))
    label(axes, 14.15, 3.4, "enabled\nand sound", ha="left", size=9)
    draw_arrow(axes, (12.35, 1.2), (3.25, 1.2))
    label(axes, 7.8, 0.9, "unsound for 1 s, or without driver for 10 s", size=9)
    draw_arrow(axes, (1.5, 1.75), (1.5, 5.05))
    label(axes, 1.35, 3.4, "at rest", ha="right", size=9)
    draw_path(axes, [(2.5, 1.75), (2.5, 3.3), (5.95, 3.3)])
    label(axes, 4.3, 3.1, "at rest, after\nunsound readings", size=9, va="top")
    draw_arrow(axes, (7.2, 5.05), (7.2, 3.85))
    label(axes, 7.35, 4.45, "unsound for 1 s", ha="left", size=9)
    label(
        axes,
        8.6,
        3.3,
        "until an operator\nresets the arm",
        ha="left",
        size=9,
        color=GRAY,
    )
    save(figure, "stages")


def main() -> None:
    """Draw all diagrams."""
    mpl.rcParams.update({"font.size": 11, "svg.hashsalt": "concepts"})
    make_spaces()
    make_loop()
    make_filter()
    make_forward_model()
    make_planner()
    make_stages()


if __name__ == "__main__":
    main()
