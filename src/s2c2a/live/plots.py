"""Live plots: the last seconds of errors, bends, cable actions and computing time."""

from collections import deque
from collections.abc import Mapping

import numpy as np
from viser import GuiApi, GuiUplotHandle, uplot

from s2c2a.arm import ArmSpec
from s2c2a.live.snapshot import Snapshot
from s2c2a.spaces import AXIS
from s2c2a.viz.colors import DESIRED, MUTED, REAL, module_colors

DURATION = 20.0  # s
HEIGHT = 124  # pixels
LEGEND_HEIGHT = 26  # pixels
MAX_NAMED = 6  # modules up to which a legend is shown


class Plots:
    """Six charts; those of clearance and of predictive uncertainty appear with data."""

    def __init__(self, gui: GuiApi, arm: ArmSpec):
        """Add empty charts to a panel."""
        self._rows: deque[list[np.ndarray]] = deque(
            maxlen=round(DURATION * arm.control_rate)
        )
        modules = {}
        cables = {}
        for module, color in enumerate(module_colors(arm.module_count)):
            modules[f"module {module + 1}"] = color
            for cable in range(arm.cable_count):
                cables[f"module {module + 1}, {cable + 1}"] = color
        unit, self._scale = unit_of_cables(arm)
        charts = {
            "tip error [cm]": {"error": DESIRED},
            "predicted tip error, std [cm]": {"predictive_std": MUTED},
            "tip clearance [cm]": {"clearance": MUTED},
            "module bends [deg]": modules,
            f"cables [{unit}]": cables,
            "computing time [ms]": {"tick": REAL},
        }
        time_axis = uplot.Scale(time=False, range=(-DURATION, 0.0))
        self._charts = []
        for title, lines in charts.items():
            legend = lines is modules and len(modules) <= MAX_NAMED
            chart = add_chart(gui, title, lines, legend=legend, x_scale=time_axis)
            self._charts.append(chart)

    def add(self, snapshot: Snapshot) -> None:
        """Append one control step."""
        axes = np.concatenate([[[0.0, 0.0, 1.0]], snapshot.states[:, AXIS]])
        cosines = np.sum(axes[1:] * axes[:-1], axis=-1)
        bends = np.rad2deg(np.arccos(np.clip(cosines, -1.0, 1.0)))
        # not every model predicts an uncertainty
        self._charts[1].visible = bool(snapshot.predictive_std > 0.0)
        self._charts[2].visible = bool(np.isfinite(snapshot.clearance))
        values = [
            snapshot.step.moment,
            # an axis of less than 10 µm would repeat one number
            np.round(100 * snapshot.error, 3),
            100 * snapshot.predictive_std,
            100 * snapshot.clearance,
            bends,
            self._scale * snapshot.step.action,
            1e3 * snapshot.step.tick_time,
        ]
        self._rows.append([np.ravel(row) for row in values])

    def draw(self) -> None:
        """Update the charts; requires at least one `add`."""
        columns = [np.transpose(column) for column in zip(*self._rows, strict=True)]
        times = columns[0][0]
        for chart, lines in zip(self._charts, columns[1:], strict=True):
            shown = latest_stretch(lines)
            ages = times[shown] - times[-1]
            chart.data = (ages, *lines[:, shown])


def latest_stretch(lines: np.ndarray) -> slice:
    """The last columns in a row that are finite, of lines of shape (lines, times).

    A chart cannot show a gap: a NaN would empty it, and a line would cross the gap.
    """
    finite = np.flatnonzero(np.isfinite(lines).all(axis=0))
    if not finite.size:
        return slice(0)
    breaks = np.flatnonzero(np.diff(finite) > 1)
    start = finite[breaks[-1] + 1] if breaks.size else finite[0]
    return slice(start, finite[-1] + 1)


def unit_of_cables(arm: ArmSpec) -> tuple[str, float]:
    """Displayed unit of the cables, and how many of it are one SI unit."""
    return {"m": ("mm", 1e3), "N": ("N", 1.0), "Pa": ("kPa", 1e-3)}[arm.unit]


def add_chart(
    gui: GuiApi,
    title: str,
    lines: Mapping[str, str],
    values: tuple = (),
    label="s",
    legend=True,
    x_scale=None,
) -> GuiUplotHandle:
    """Add a chart to a panel.

    Args:
        gui: of the panel.
        title: of the chart.
        lines: colors by the lines' names.
        values: x values, then the y values of each line; empty by default.
        label: of the x axis.
        legend: whether to show the legend.
        x_scale: scale of the x axis; fits the values by default.
    """
    series = [uplot.Series(label=label)]
    for name, color in lines.items():
        series.append(uplot.Series(label=name, stroke=color, width=1.6))
    return gui.add_uplot(
        values or tuple(np.zeros(2) for _ in series),
        tuple(series),
        title=title,
        scales={"x": x_scale or uplot.Scale(time=False)},
        legend=uplot.Legend(show=legend, live=False),
        height=HEIGHT + (LEGEND_HEIGHT if legend else 0),
    )
