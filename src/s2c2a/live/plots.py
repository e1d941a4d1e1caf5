"""Live plots: the last seconds of error, clearance, bends, cable actions and planning time."""

from collections import deque
from collections.abc import Mapping

import numpy as np
from viser import GuiApi, GuiUplotHandle, uplot

from s2c2a.arm import ArmSpec
from s2c2a.live.snapshot import Snapshot
from s2c2a.spaces import AXIS
from s2c2a.viz.colors import MUTED, REAL, TARGET, module_colors

SHOWN = 20.0  # s
HEIGHT = 124  # pixels
MAX_NAMED = 6  # modules whose names are written under a chart


class Plots:
    """Six charts in the shared panel; that of clearances is there while there are obstacles."""

    def __init__(self, gui: GuiApi, arm: ArmSpec):
        """Empty charts."""
        self._rows: deque[list[np.ndarray]] = deque(
            maxlen=round(SHOWN * arm.control_rate)
        )
        modules = {
            f"module {k + 1}": color
            for k, color in enumerate(module_colors(arm.module_count))
        }
        cables = {
            f"{name}, {k + 1}": color
            for name, color in modules.items()
            for k in range(arm.cable_count)
        }
        unit, self._scale = unit_of_cables(arm)
        across = uplot.Scale(time=False, range=(-SHOWN, 0.0))
        self._charts = [
            add_chart(
                gui,
                title,
                lines,
                legend=lines is modules and len(modules) <= MAX_NAMED,
                across=across,
            )
            for title, lines in (
                ("tip from its target [cm]", {"error": TARGET}),
                ("the model may be off by [cm]", {"predictive_std": MUTED}),
                ("clearance of the tip [cm]", {"clearance": MUTED}),
                ("bend of the modules [deg]", modules),
                (f"cables [{unit}]", cables),
                ("sense, plan, act [ms]", {"tick": REAL}),
            )
        ]

    def add(self, snapshot: Snapshot) -> None:
        """One more control step."""
        axes = np.concatenate([[[0.0, 0.0, 1.0]], snapshot.states[:, AXIS]])
        bends = np.rad2deg(
            np.arccos(np.clip(np.sum(axes[1:] * axes[:-1], axis=-1), -1.0, 1.0))
        )
        # not every model knows
        self._charts[1].visible = bool(snapshot.deviation > 0.0)
        self._charts[2].visible = bool(np.isfinite(snapshot.clearance))
        lengths = [
            100 * one
            for one in (snapshot.error, snapshot.deviation, snapshot.clearance)
        ]
        values = [
            snapshot.step.moment,
            *lengths,
            bends,
            self._scale * snapshot.step.action,
        ]
        values += [1e3 * snapshot.step.tick_time]
        # with NaN a chart stays empty
        self._rows.append([np.nan_to_num(np.ravel(one), posinf=0.0) for one in values])

    def draw(self) -> None:
        """Send the charts what is new, after the first `add`."""
        (seconds,), *parts = (
            np.transpose(part) for part in zip(*self._rows, strict=True)
        )
        for chart, part in zip(self._charts, parts, strict=True):
            chart.data = (seconds - seconds[-1], *part)


def unit_of_cables(arm: ArmSpec) -> tuple[str, float]:
    """The unit in which cables are shown, and how many of it are one of the arm's."""
    return ("mm", 1e3) if arm.actuation == "displacement" else ("N", 1.0)


def add_chart(
    gui: GuiApi,
    title: str,
    lines: Mapping[str, str],
    values: tuple = (),
    label="s",
    legend=True,
    across=None,
) -> GuiUplotHandle:
    """A chart in a panel.

    Args:
        gui: of the panel.
        title: above it.
        lines: the color of each, by name.
        values: what is along, then every line's; empty unless stated.
        label: of what is along.
        legend: whether the lines' names are shown.
        across: the scale of what is along; as wide as the values unless stated.
    """
    return gui.add_uplot(
        values or tuple(np.zeros(2) for _ in range(len(lines) + 1)),
        (
            uplot.Series(label=label),
            *(
                uplot.Series(label=name, stroke=lines[name], width=1.6)
                for name in lines
            ),
        ),
        title=title,
        scales={"x": across or uplot.Scale(time=False)},
        legend=uplot.Legend(show=legend, live=False),
        height=HEIGHT + (26 if legend else 0),
    )
