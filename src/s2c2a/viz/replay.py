"""A page that replays runs: one file, opened in any browser, without a network; `page/run.js` reads what is in it.

Lengths travel as whole tenths of a millimeter, unit vectors as whole ten-thousandths,
errors as whole micrometres and microradians, their mean in meters; NaN travels as null.
"""

import html
import json
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from string import Template

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.files import save_whole
from s2c2a.viz.colors import (
    GRID,
    GRID_STRONG,
    INK,
    OBSTACLE,
    TARGET,
    colors_by_label,
    module_colors,
)
from s2c2a.viz.mesh import BODY_ROWS, ArmMesh, frames_of
from s2c2a.viz.mounting import Surroundings
from s2c2a.viz.trace import Trace, check_same_arm

SCRIPTS = (
    "vectors",
    "run",
    "camera",
    "shading",
    "arm",
    "surroundings",
    "scene",
    "chart",
    "panel",
    "player",
    "main",
)
PER_UNIT = 10_000  # whole numbers in a meter, or in the length of a unit vector
# whole numbers in a meter or radian of error; finer, for they are shown to 0.01 cm
PER_ERROR = 1_000_000


def replay_page(
    traces: Sequence[Trace],
    arm: ArmSpec,
    title: str,
    path: str | Path,
    summary: Mapping[str, str] | None = None,
) -> Path:
    """Write a page on which the runs can be watched: arm, paths, targets, obstacles, error.

    The page needs nothing but itself. Drag to orbit, wheel or pinch to zoom, space to
    play, arrows to step; a fragment such as `#t=4.5` opens it at that second.

    Args:
        traces: runs of the same task, base frame; the first is shown as the arm, the
            others as ghosts until chosen.
        arm: the arm that ran them.
        title: heading of the page.
        path: file to write; replaced if it exists.
        summary: names and values to list beside the scene, such as metrics or versions.

    Raises:
        S2C2AError: no trace, a trace of another arm, or the file cannot be written.
    """
    check_same_arm(traces, arm)
    mesh = ArmMesh(arm)
    modules = module_colors(arm.module_count)
    colors = colors_by_label(trace.label for trace in traces)
    data = {
        "title": title,
        "summary": [[str(name), str(value)] for name, value in (summary or {}).items()],
        "colors": {
            "desired": TARGET,
            "obstacle": OBSTACLE,
            "grid": GRID,
            "strong": GRID_STRONG,
            "ink": INK,
        },
        "arm": {
            "name": arm.name,
            "lengths": [module.length for module in arm.modules],
            "colors": modules,
        },
        "mesh": {
            "sections": mesh.sections,
            "bodyRows": BODY_ROWS,
            "pieces": mesh.pieces,
        },
        "surroundings": vars(Surroundings.of(arm)),
        "traces": [_trace_data(trace, colors[trace.label]) for trace in traces],
    }
    text = json.dumps(data, separators=(",", ":"), allow_nan=False, default=_plain)
    page = Template(_part("replay.html")).substitute(
        title=html.escape(title),
        style=_part("page/style.css"),
        # whatever strings it holds
        data=text.replace("&", "\\u0026")
        .replace("<", "\\u003c")
        .replace(">", "\\u003e"),
        scripts="\n".join(_part(f"page/{name}.js") for name in SCRIPTS),
    )
    return save_whole(page.encode("utf-8"), path)


def _part(name: str) -> str:
    """A file of the page, as it ships with the package."""
    return resources.files("s2c2a.viz").joinpath(name).read_text(encoding="utf-8")


def _plain(value):
    """Arrays as lists to a hundredth of a millimeter, and what is made of plain values as those."""
    return (
        value.round(5).tolist()
        if isinstance(value, np.ndarray | np.generic)
        else vars(value)
    )


def _trace_data(trace: Trace, color: str) -> dict:
    frames = frames_of(trace.states)[:, 1:, [0, 1, 3]]
    obstacles = trace.obstacles
    return {
        "label": trace.label,
        "color": color,
        "followed": trace.followed_module,
        "times": trace.times.round(4).tolist(),
        # (time, modules * 9): position, x axis, z axis
        "frames": _points(frames.reshape(trace.times.size, -1)),
        "desired": _asked(trace.desired_positions),
        "axes": _asked(trace.desired_axes),
        "obstacles": _whole(
            obstacles[:1] if (obstacles == obstacles[:1]).all() else obstacles
        ),
        "errors": _whole(trace.position_errors, PER_ERROR),
        "meanError": float(trace.counted_errors.mean())
        if trace.counted_errors.size
        else None,
        "uncounted": [
            [round(start, 4), round(end, 4)] for start, end in trace.uncounted_spans
        ],
        "axisErrors": _whole(trace.axis_errors, PER_ERROR),
    }


def _asked(desired: np.ndarray) -> dict[str, list]:
    """For each module of which something is asked, its points over time, null where nothing is."""
    asked = np.isfinite(desired).all(axis=-1).any(axis=0)
    return {
        str(module): _points(desired[:, module]) for module in np.flatnonzero(asked)
    }


def _points(values: np.ndarray) -> list:
    """Rows of whole numbers, null for a row that is not wholly finite."""
    return [None if None in row else row for row in _whole(values)]


def _whole(values: np.ndarray, per_unit: int = PER_UNIT) -> list:
    """Nested lists of whole numbers, None where a value is not finite."""
    finite = np.isfinite(values)
    whole = np.rint(per_unit * np.where(finite, values, 0.0)).astype(int).astype(object)
    whole[~finite] = None
    return whole.tolist()
