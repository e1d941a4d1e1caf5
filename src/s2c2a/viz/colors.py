"""Colors with a meaning, the same in every figure and on every page (Chen et al. 2025, figures 3 and 6)."""

from collections.abc import Iterable
from itertools import cycle

import numpy as np

DESIRED = "#d62728"  # in figures
TARGET = "#7b35c9"  # the same where the arm's body is drawn, whose end is red
POINTING = "#e0a100"
REAL = "#1f5fc4"  # where the arm was
OBSTACLE = "#8a93a6"
# of the arm's body, beside its modules
DISC = "#c4cbd5"
BASE = "#8791a0"
GRID = "#d9dfe7"
GRID_STRONG = "#b3bdc9"
INK = "#17202b"
MUTED = "#5b6675"
FAINT = "#dfe4ea"

_BASE_TO_END = np.array([(47, 111, 219), (52, 168, 83), (224, 70, 58)])
_CONTROLLERS = {
    "s2c2a": "#1f5fc4",
    "pcc": "#2b9a4b",
    "pcc-fitted": "#c77d0a",
    "lstm": "#0d8fa0",
}
_OTHERS = ("#1f5fc4", "#2b9a4b", "#c77d0a", "#0d8fa0", "#b8327f", "#6b7280", "#7a5230")


def rgb(color: str) -> tuple[int, int, int]:
    """A color as three numbers of 0 to 255."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def darker(color: str) -> str:
    """Half as bright."""
    return "#{:02x}{:02x}{:02x}".format(*(value // 2 for value in rgb(color)))


def module_colors(count: int) -> list[str]:
    """A color for each module: base blue, middle green, end red, and between them what lies between."""
    places = np.linspace(0, len(_BASE_TO_END) - 1, count)
    channels = [
        np.interp(places, range(len(_BASE_TO_END)), channel)
        for channel in _BASE_TO_END.T
    ]
    return [
        "#{:02x}{:02x}{:02x}".format(*(round(value) for value in color))
        for color in zip(*channels, strict=True)
    ]


def colors_by_label(labels: Iterable[str]) -> dict[str, str]:
    """A color for each strategy: its own where it has one, else the first that no other one uses."""
    own = {label: _CONTROLLERS.get(label.lower()) for label in labels}
    others = cycle([color for color in _OTHERS if color not in own.values()] or _OTHERS)
    return {label: color or next(others) for label, color in own.items()}
