"""Tasks by name, or from a file of waypoints."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from s2c2a.arm import ArmSpec
from s2c2a.errors import TargetError
from s2c2a.tasks.circle import circle, tilt
from s2c2a.tasks.follow import follow
from s2c2a.tasks.hold import hold_base, hold_end, hold_middle
from s2c2a.tasks.obstacles import REACH, flee, reach
from s2c2a.tasks.task import Task
from s2c2a.tasks.waypoints import load_waypoints, waypoints_task

TILTS = {
    "tilt-40": (40.0, 0.0),
    "tilt-50": (50.0, 0.0),
    "tilt-60": (60.0, 0.0),
    "tilt-0": (0.0, 0.0),
    "tilt-50-a20": (50.0, 20.0),
    "tilt-50-c20": (50.0, -20.0),
}
"""Tilt from the vertical, and azimuth from the radial direction [deg] (Chen et al. 2025, table III)."""

TASKS: dict[str, Callable[[ArmSpec], Task]] = {
    "circle": circle,
    **{name: partial(tilt, name=name, angle_deg=angle, turned_deg=turned) for name, (angle, turned) in TILTS.items()},
    "hold-base": hold_base,
    "hold-middle": hold_middle,
    "hold-end": hold_end,
    **{name: partial(reach, name=name) for name in REACH},
    "flee": flee,
    "follow": follow,
}


def task_named(name: str, arm: ArmSpec) -> Task:
    """The task of that name for an arm, or the one in a file of waypoints.

    Raises:
        TargetError: no such task, or a file that holds none.
    """
    if name in TASKS:
        return TASKS[name](arm)
    if name.endswith(".csv"):
        return waypoints_task(Path(name).stem, load_waypoints(name), arm)
    raise TargetError(f"no task '{name}'; choose one of {', '.join(TASKS)}, or a file of waypoints ending in .csv")
