"""A page that replays runs: one file, opened in any browser, without a network."""

import html
import os
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path

from s2c2a.arm import ArmSpec
from s2c2a.files import save_whole
from s2c2a.viz.run_data import json_for_script, run_data
from s2c2a.viz.trace import Trace, check_same_arm

SCRIPTS = ("vectors", "run", "camera", "shading", "arm", "surroundings", "scene", "chart", "panel", "player", "main")
_PLACE = re.compile(r"\{\{(\w+)\}\}")


def replay_page(
    traces: Sequence[Trace],
    arm: ArmSpec,
    title: str,
    path: str | os.PathLike,
    summary: Mapping[str, str] | None = None,
) -> Path:
    """Write a page on which the runs can be watched: arm, paths, targets, obstacles, error.

    The page needs nothing but itself. Drag to orbit, wheel or pinch to zoom, space to play, arrows to step; a fragment
    such as `#t=4.5` opens it at that second.

    Args:
        traces: runs of the same task, base frame; the first is shown as the arm, the others as ghosts until chosen.
        arm: the arm that ran them.
        title: heading of the page.
        path: file to write; replaced if it exists.
        summary: names and values to list beside the scene, such as metrics or versions.

    Raises:
        S2C2AError: no trace, a trace of another arm, or the file cannot be written.
    """
    check_same_arm(traces, arm)
    page = _fill(
        _part("replay.html"),
        title=html.escape(title),
        style=_part("page/style.css"),
        data=json_for_script(run_data(traces, arm, title, summary or {})),
        scripts="\n".join(_part(f"page/{name}.js") for name in SCRIPTS),
    )
    return save_whole(page.encode("utf-8"), path)


def _part(name: str) -> str:
    """A file of the page, as it ships with the package."""
    return resources.files("s2c2a.viz").joinpath(name).read_text(encoding="utf-8")


def _fill(template: str, **values: str) -> str:
    """Put values in their places in one pass, so that a value is never searched for places itself."""
    return _PLACE.sub(lambda place: values[place[1]], template)
