"""Live plots: the last seconds of error, clearance, bends, cable actions and planning time."""

from collections import deque

import numpy as np
from viser import GuiApi, uplot

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.live.loop import Snapshot
from s2c2a.viz.colours import WANTED, module_colours

SHOWN = 20.0  # s
HEIGHT = 124  # pixels
CLEARANCE_COLOUR, TIME_COLOUR = "#5b6675", "#1f5fc4"


class Plots:
    """Four charts in the shared panel."""

    def __init__(self, gui: GuiApi, arm: ArmSpec):
        """Empty charts."""
        self._arm, self._geometry = arm, ArmGeometry.of(arm)
        self._rows: deque[np.ndarray] = deque(maxlen=round(SHOWN * arm.control_rate))
        colours = module_colours(arm.module_count)
        names = [f"module {number + 1}" for number in range(arm.module_count)]
        many = arm.module_count <= 6
        unit, self._scale = ("mm", 1e3) if arm.actuation == "displacement" else ("N", 1.0)
        cables = [colour for colour in colours for _ in range(arm.cable_count)]
        self._charts = [
            _chart(gui, "tip: error and clearance [cm]", ["error", "clearance"], [WANTED, CLEARANCE_COLOUR], True),
            _chart(gui, "bend of the modules [deg]", names, colours, many),
            _chart(gui, f"cables [{unit}]", [""] * len(cables), cables, False),
            _chart(gui, "sense, plan, act [ms]", ["tick"], [TIME_COLOUR], False),
        ]

    def add(self, snapshot: Snapshot) -> None:
        """One more control step."""
        bends = np.rad2deg(np.arccos(np.clip(snapshot.configurations[:, 2], -1.0, 1.0)))
        clearance = 100 * snapshot.clearance if np.isfinite(snapshot.clearance) else np.nan
        values = [snapshot.number * snapshot.period, 100 * snapshot.error, clearance, *bends]
        self._rows.append(np.array([*values, *(self._scale * snapshot.actions).ravel(), 1e3 * snapshot.tick_time]))

    def draw(self) -> None:
        """Send the charts what is new."""
        if len(self._rows) < 2:
            return
        columns = np.array(self._rows).T
        seconds, modules = columns[0] - columns[0, -1], self._arm.module_count
        parts = np.split(columns[1:], np.cumsum([2, modules, self._geometry.action_neutral.size]))
        for chart, part in zip(self._charts, parts, strict=True):
            chart.data = (seconds, *part)


def _chart(gui: GuiApi, title: str, names: list[str], colours: list[str], legend: bool):
    empty = tuple(np.zeros(2) for _ in range(len(names) + 1))
    lines = [uplot.Series(label=name, stroke=colour, width=1.6) for name, colour in zip(names, colours, strict=True)]
    return gui.add_uplot(
        empty,
        (uplot.Series(label="s"), *lines),
        title=title,
        scales={"x": uplot.Scale(time=False, range=(-SHOWN, 0.0))},
        legend=uplot.Legend(show=legend, live=False),
        height=HEIGHT + (26 if legend else 0),
    )
