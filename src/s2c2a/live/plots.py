"""Live plots: the last seconds of error, clearance, bends, cable actions and planning time."""

from collections import deque
from collections.abc import Mapping

import numpy as np
from viser import GuiApi, uplot

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.live.snapshot import Snapshot
from s2c2a.viz.colours import TARGET, module_colours

SHOWN = 20.0  # s
HEIGHT = 124  # pixels
CLEARANCE_COLOUR, TIME_COLOUR = "#5b6675", "#1f5fc4"


class Plots:
    """Five charts in the shared panel; that of clearances is there while there are obstacles."""

    def __init__(self, gui: GuiApi, arm: ArmSpec):
        """Empty charts."""
        self._arm, self._geometry = arm, ArmGeometry.of(arm)
        self._rows: deque[np.ndarray] = deque(maxlen=round(SHOWN * arm.control_rate))
        colours = module_colours(arm.module_count)
        names = [f"module {number + 1}" for number in range(arm.module_count)]
        unit, self._scale = ("mm", 1e3) if arm.actuation == "displacement" else ("N", 1.0)
        cables = {
            f"{module}, {cable + 1}": colour
            for module, colour in zip(names, colours, strict=True)
            for cable in range(arm.cable_count)
        }
        seconds = uplot.Scale(time=False, range=(-SHOWN, 0.0))
        self._charts = [
            add_chart(gui, title, lines, legend=legend, across=seconds)
            for title, lines, legend in (
                ("tip from its target [cm]", {"error": TARGET}, False),
                ("clearance of the tip [cm]", {"clearance": CLEARANCE_COLOUR}, False),
                ("bend of the modules [deg]", dict(zip(names, colours, strict=True)), arm.module_count <= 6),
                (f"cables [{unit}]", cables, False),
                ("sense, plan, act [ms]", {"tick": TIME_COLOUR}, False),
            )
        ]

    def add(self, snapshot: Snapshot) -> None:
        """One more control step."""
        bends = np.rad2deg(np.arccos(np.clip(snapshot.configurations[:, 2], -1.0, 1.0)))
        error, clearance = (
            100 * value if np.isfinite(value) else 0.0 for value in (snapshot.error, snapshot.clearance)
        )  # a chart with a NaN in it stays empty
        if self._charts[1].visible != (seen := bool(np.isfinite(snapshot.clearance))):
            self._charts[1].visible = seen
        values = [snapshot.number * snapshot.period, error, clearance, *bends]
        self._rows.append(np.array([*values, *(self._scale * snapshot.actions).ravel(), 1e3 * snapshot.tick_time]))

    def draw(self) -> None:
        """Send the charts what is new."""
        if len(self._rows) < 2:
            return
        columns = np.array(self._rows).T
        seconds, modules = columns[0] - columns[0, -1], self._arm.module_count
        parts = np.split(columns[1:], np.cumsum([1, 1, modules, self._geometry.action_neutral.size]))
        for chart, part in zip(self._charts, parts, strict=True):
            chart.data = (seconds, *part)


def add_chart(
    gui: GuiApi,
    title: str,
    lines: Mapping[str, str],
    values: tuple[np.ndarray, ...] | None = None,
    label: str = "s",
    legend: bool = True,
    across: uplot.Scale | None = None,
):
    """A chart in a panel.

    Args:
        gui: of the panel.
        title: above it.
        lines: the colour of each, by name.
        values: what is along, then every line's; empty unless stated.
        label: of what is along.
        legend: whether the lines' names are shown.
        across: the scale of what is along; as wide as the values unless stated.
    """
    empty = tuple(np.zeros(2) for _ in range(len(lines) + 1))
    series = [uplot.Series(label=name, stroke=colour, width=1.6) for name, colour in lines.items()]
    return gui.add_uplot(
        values or empty,
        (uplot.Series(label=label), *series),
        title=title,
        scales={"x": across or uplot.Scale(time=False)},
        legend=uplot.Legend(show=legend, live=False),
        height=HEIGHT + (26 if legend else 0),
    )
