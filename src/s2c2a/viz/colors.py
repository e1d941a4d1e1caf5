"""Colors with a fixed meaning, shared by figures, videos, replay and live pages.

Modules and the strategies have the colors of figures 3 and 6 of Chen
et al. 2025.
"""

from collections.abc import Iterable
from itertools import cycle

import numpy as np

DESIRED = "#7b35c9"  # desired paths and targets everywhere; red is the last module
REAL = "#1f5fc4"  # measured path
OBSTACLE = "#8a93a6"
UNCOUNTED = "#e6eaf0"  # steps that the mean error leaves out
DISC = "#c4cbd5"
BASE = "#8791a0"
GRID = "#d9dfe7"
GRID_STRONG = "#b3bdc9"
INK = "#17202b"
MUTED = "#5b6675"
FAINT = "#dfe4ea"
WARNING = "#f0a000"  # an arm near an obstacle, a target out of reach
TOUCHED = "#d62728"  # an obstacle that the arm touches

_BASE_TO_TIP = np.array([(47, 111, 219), (52, 168, 83), (224, 70, 58)])  # RGB
PALETTE = (REAL, "#2b9a4b", "#c77d0a", "#0d8fa0", "#b8327f", "#6b7280", "#7a5230")
_STRATEGY_COLORS = dict(
    zip(("s2c2a", "pcc", "pcc-fitted", "lstm"), PALETTE, strict=False)
)


def rgb(color: str) -> tuple[int, int, int]:
    """Red, green and blue of a "#rrggbb" color, each 0 to 255."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def darker(color: str) -> str:
    """A color of half the brightness."""
    return _hex(value // 2 for value in rgb(color))


def pale(color: str, share: float = 0.8) -> str:
    """A color mixed with a share of white."""
    return _hex(round(value + share * (255 - value)) for value in rgb(color))


def module_colors(count: int) -> list[str]:
    """Colors of the modules, interpolated from blue (base) over green to red (tip)."""
    knots = range(len(_BASE_TO_TIP))
    places = np.linspace(0, len(_BASE_TO_TIP) - 1, count)
    channels = [np.interp(places, knots, channel) for channel in _BASE_TO_TIP.T]
    return [_hex(map(round, color)) for color in zip(*channels, strict=True)]


def colors_by_label(labels: Iterable[str]) -> dict[str, str]:
    """Color of each label: that of a known strategy, else an unused one."""
    colors = {label: _STRATEGY_COLORS.get(label.lower()) for label in labels}
    unused = [color for color in PALETTE if color not in colors.values()]
    spare = cycle(unused or PALETTE)
    return {label: color or next(spare) for label, color in colors.items()}


def _hex(channels: Iterable[int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*channels)
