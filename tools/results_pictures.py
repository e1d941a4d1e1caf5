"""Pictures of docs/results/, drawn from the rows in `results/`."""

import io
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass

import matplotlib
from matplotlib.figure import Figure

from s2c2a.viz.colors import GRID, colors_by_label

from tools import ROOT
from tools.page_tables import (
    MAIN_LINES,
    MOVING_ARMS,
    PAYLOADS_G,
    STRENGTHS,
    TURNS,
    mean_value,
    moving_error,
    real_tips,
    sensor_row,
)
from tools.results_tables import find_row, load_rows

FOLDER = ROOT / "docs" / "pictures"
SIZE = (8.0, 3.0)  # inches, as wide as a page
SHARE = 0.8  # of the distance between groups that their bars take
MODELS = ("best", "paper", "pcc", "pcc-fitted")
"""Names that have the same color in all pictures that show any of them."""
SETTINGS = {"svg.hashsalt": "s2c2a", "svg.fonttype": "none", "font.size": 9}
"""The same rows make the same file; words stay words, which readers can search."""


@dataclass(frozen=True)
class Bars:
    """Groups of bars.

    Attributes:
        label: what the bars show, with its unit.
        groups: name of each group.
        series: values of the bars of a color, one for each group; None for no bar.
    """

    label: str
    groups: list[str]
    series: dict[str, list[float | None]]


def paper_bars() -> Bars:
    """Tasks of the paper: first error of each line of the table."""
    lines = [line for line in MAIN_LINES if "clearance" not in line.metrics]
    series: dict[str, list[float | None]] = {"the paper's arm": []}
    for recipe in ("paper", "best"):
        series[recipe] = []
        for line in lines:
            match = {**line.match, "arm": "twin_arm", "strategy": "s2c2a"}
            file = f"{recipe}/{match.pop('table')}.json"
            row = find_row(file, metric=line.metrics[0], **match)
            series[recipe].append(row["mean"])
            if recipe == "paper":
                series["the paper's arm"].append(row["paper_mean"])
    groups = [line.match["task"].replace("mean of ", "") for line in lines]
    return Bars("error [cm]", groups, series)


def randomized_bars() -> Bars:
    """Circle and tilts of randomized arms."""
    cases = [
        (degree, file, task)
        for degree, file in STRENGTHS
        for task in ("circle", "mean of 6 tilt tasks")
    ]
    series = {
        name: [mean_value(file, task, "position", name) for _, file, task in cases]
        for name in ("best", "best-long", "paper", "pcc-fitted", "pcc")
    }
    groups = [f"{degree}: {task.replace('mean of ', '')}" for degree, _, task in cases]
    return Bars("mean error [cm]", groups, series)


def sensor_bars() -> Bars:
    """The circle with payloads, by sensors."""
    sensors = {
        "encoders": "encoders",
        "payload known": "encoders-known-payload",
        "inertial": "imu",
        "currents": "current",
        "camera": "camera",
        "flex": "flex",
    }
    series = {
        f"{payload} g": [sensor_row(name, payload)["mean"] for name in sensors.values()]
        for payload in PAYLOADS_G
    }
    return Bars("error on the circle [cm]", list(sensors), series)


def speed_bars() -> Bars:
    """Circles at several times a turn."""
    series = {
        arm: [moving_error(arm, f"circle, {turn} a turn") for turn in TURNS]
        for arm in MOVING_ARMS
    }
    return Bars("error [cm]", [f"{turn} a turn" for turn in TURNS], series)


def recording_bars() -> Bars:
    """Tips of models on recordings."""
    tips = real_tips()
    series = {
        model: [line[model] for line in tips.values()]
        for model in ("best", "process", "paper", "pcc-fitted")
    }
    groups = [title.replace("`", "").replace(", ", "\n") for title in tips]
    return Bars("tip error [mm]", groups, series)


def growth_bars() -> Bars:
    """Plans of arms of more modules, and beside more obstacles."""
    rows = load_rows("performance/times.json")
    series: dict[str, list[float | None]] = {"best": [], "paper": []}
    groups = []
    for kind in ("modules", "obstacles"):
        for name in series:
            grown = [
                row
                for row in rows
                if row["benchmark"].startswith(f"bench_growth: {kind}[")
                and name in row["benchmark"]
            ]
            grown.sort(key=lambda row: row["size"])
            series[name] += [row["median"] for row in grown]
        groups += [f"{row['size']}" for row in grown]
        groups[-len(grown)] += f"\n{kind}"
    return Bars("plan [ms]", groups, series)


PICTURES: dict[str, Callable[[], Bars]] = {
    "results-paper": paper_bars,
    "results-randomized": randomized_bars,
    "results-sensors": sensor_bars,
    "results-speed": speed_bars,
    "results-recordings": recording_bars,
    "results-growth": growth_bars,
}
"""Functions that give the bars of a picture, by the name of its file."""


def values_of(bars: Bars) -> str:
    """Text of all values, which the file of the picture contains."""
    return json.dumps(asdict(bars))


def drawn(bars: Bars) -> str:
    """The picture as SVG."""
    with matplotlib.rc_context(SETTINGS):
        figure = Figure(SIZE, layout="constrained")
        axes = figure.subplots()
        width = SHARE / len(bars.series)
        shared = MODELS if "best" in bars.series else ()
        colors = colors_by_label([*shared, *bars.series])
        for number, (name, values) in enumerate(bars.series.items()):
            left = number * width - SHARE / 2 + width / 2
            shown = [
                (i + left, value) for i, value in enumerate(values) if value is not None
            ]
            places, heights = zip(*shown, strict=True)
            axes.bar(places, heights, width=width, label=name, color=colors[name])
        axes.set_xticks(range(len(bars.groups)), bars.groups)
        axes.set_ylabel(bars.label)
        axes.grid(axis="y", color=GRID)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False)
        content = io.StringIO()
        metadata = {"Date": None, "Creator": None, "Description": values_of(bars)}
        figure.savefig(content, format="svg", metadata=metadata)
    return content.getvalue()


def write_pictures() -> None:
    """Draw all pictures."""
    for name, bars in PICTURES.items():
        (FOLDER / f"{name}.svg").write_text(drawn(bars()), encoding="utf-8")
