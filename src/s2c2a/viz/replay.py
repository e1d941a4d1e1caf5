"""Replay page: one HTML file that shows runs in any browser, without a network.

`page/run.js` reads the data. Lengths are integers of 0.1 mm, unit vectors of 1/10 000,
errors of 1 µm or 1 µrad; mean errors are in meters. NaN becomes null.
"""

import html
import json
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from pathlib import Path
from string import Template

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.files.text import write_atomically
from s2c2a.obstacles import CENTER, CORE, is_sphere
from s2c2a.viz import colors
from s2c2a.viz.arrays import Points
from s2c2a.viz.mesh import BODY_ROWS, ArmMesh, frames_of
from s2c2a.viz.mounting import Surroundings
from s2c2a.viz.solids import surface
from s2c2a.viz.trace import Trace, check_same_arm, modules_with_goal, standing

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
PER_UNIT = 10_000  # integers in a meter, or in the length of a unit vector
PER_ERROR = 1_000_000  # integers in a meter or radian of error; shown to 0.01 cm


def replay_page(
    traces: Sequence[Trace],
    arm: ArmSpec,
    title: str,
    path: str | Path,
    summary: Mapping[str, str] | None = None,
) -> Path:
    """Write a page that replays runs with arm, paths, targets, obstacles and errors.

    The page is self-contained. Drag to orbit, use the wheel or pinch to zoom, the space
    bar to play, the arrow keys to step. A fragment such as `#t=4.5` opens the page at
    that second.

    Args:
        traces: runs of the same task, base frame. The page first shows the first run
            as the arm and the others as ghosts.
        arm: the arm that ran them.
        title: heading of the page.
        path: file to write; replaced if it exists.
        summary: names and values beside the scene, such as metrics or versions.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: there is no trace, a trace is of another arm, or the file cannot be
            written.
    """
    check_same_arm(traces, arm)
    data = _page_data(traces, arm, title, summary or {})
    text = json.dumps(data, separators=(",", ":"), allow_nan=False, default=_to_json)
    for character in "&<>":  # so that no text can end the script element
        text = text.replace(character, f"\\u{ord(character):04x}")
    page = Template(_read_source("replay.html")).substitute(
        title=html.escape(title),
        ink=colors.INK,
        style=_read_source("page/style.css"),
        data=text,
        scripts="\n".join(_read_source(f"page/{name}.js") for name in SCRIPTS),
    )
    return write_atomically(page.encode("utf-8"), path)


def _page_data(
    traces: Sequence[Trace], arm: ArmSpec, title: str, summary: Mapping[str, str]
) -> dict:
    """Data that the page's scripts read."""
    mesh = ArmMesh(arm)
    label_colors = colors.colors_by_label(trace.label for trace in traces)
    return {
        "title": title,
        "summary": [[str(name), str(value)] for name, value in summary.items()],
        "colors": {
            "desired": colors.DESIRED,
            "obstacle": colors.OBSTACLE,
            "grid": colors.GRID,
            "strong": colors.GRID_STRONG,
            "ink": colors.INK,
            "uncounted": colors.UNCOUNTED,
            "horizon": colors.MUTED,
        },
        "arm": {
            "name": arm.name,
            "lengths": [module.length for module in arm.modules],
            "colors": colors.module_colors(arm.module_count),
        },
        "mesh": {
            "sections": mesh.sections,
            "bodyRows": BODY_ROWS,
            "pieces": mesh.pieces,
        },
        "surroundings": Surroundings.of(arm),
        "traces": [_trace_data(trace, label_colors[trace.label]) for trace in traces],
    }


def _read_source(name: str) -> str:
    """Text of a file of the page, from the package."""
    return resources.files("s2c2a.viz").joinpath(name).read_text(encoding="utf-8")


def _to_json(value):
    """Lists for arrays, rounded to 0.01 mm, and dictionaries for other objects."""
    if isinstance(value, np.ndarray | np.generic):
        return (value if value.dtype == bool else value.round(5)).tolist()
    return vars(value)


def _trace_data(trace: Trace, color: str) -> dict:
    """Data of one run."""
    frames = frames_of(trace.states)[:, 1:, [0, 1, 3]]
    obstacles = trace.obstacles
    if (obstacles == obstacles[:1]).all():
        obstacles = obstacles[:1]
    tube = np.column_stack([trace.predicted_path, trace.band])
    errors = trace.counted_errors
    return {
        "label": trace.label,
        "color": color,
        "followed": trace.followed_module,
        "times": trace.times.round(4).tolist(),
        # (time, modules * 9): position, x axis, z axis
        "frames": _rows(frames.reshape(trace.times.size, -1)),
        "desired": _goal_data(trace.desired_positions),
        "axes": _goal_data(trace.desired_axes),
        # predicted position and radius at each step
        "tube": _rows(tube) if trace.has_band else [],
        "horizon": [_rows(tips) for tips in trace.horizon],
        "obstacles": _integers(obstacles[..., : CORE.start]),
        "solids": [_integers(offsets) for offsets in _solids(trace)],
        "errors": _integers(trace.position_errors, PER_ERROR),
        "meanError": float(errors.mean()) if errors.size else None,
        "uncounted": np.round(trace.uncounted_spans, 4),
        "axisErrors": _integers(trace.axis_errors, PER_ERROR),
        "plans": _changes(trace.plan_texts),
    }


def _solids(trace: Trace) -> Iterator[Points]:
    """Points of the surface of each obstacle [m], from its center; none of a sphere."""
    for places in np.swapaxes(trace.obstacles, 0, 1):
        present = places[standing(places)]
        if len(present) and not is_sphere(present[0]):
            points = surface(present[0], trace.episode.arm.length)
            yield np.unique((points - present[0, CENTER]).round(4), axis=0)
        else:
            yield np.zeros((0, 3))


def _changes(texts: Sequence[str]) -> list[tuple[int, str]]:
    """Each step whose text differs from that of the step before, and the text."""
    before = ("", *texts)
    return [(step, text) for step, text in enumerate(texts) if text != before[step]]


def _goal_data(desired: np.ndarray) -> dict[str, list]:
    """Desired vectors over time of each module that has any, null where it has none."""
    modules = modules_with_goal(desired)
    return {str(module): _rows(desired[:, module]) for module in modules}


def _rows(values: np.ndarray) -> list:
    """Rows of integers, None for a row with a value that is not finite."""
    return [None if None in row else row for row in _integers(values)]


def _integers(values: np.ndarray, per_unit: int = PER_UNIT) -> list:
    """Nested lists of integers, None for a value that is not finite."""
    finite = np.isfinite(values)
    scaled = np.rint(per_unit * np.where(finite, values, 0.0))
    integers = scaled.astype(int).astype(object)
    integers[~finite] = None
    return integers.tolist()
