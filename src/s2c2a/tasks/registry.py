"""Tasks by name, from a table, or from a custom function."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError, TargetError
from s2c2a.plugins.discovery import resolve, trust_code
from s2c2a.runtime.border import named_errors
from s2c2a.tasks.circle import HELD, circle, hold_and_turn, hold_base, tilt
from s2c2a.tasks.lines import REACH, flee, follow, reach
from s2c2a.tasks.paths import PATHS, path
from s2c2a.tasks.shapes import table_task
from s2c2a.tasks.task import Task

TILTS = {
    "tilt-40": (40.0, 0.0),
    "tilt-50": (50.0, 0.0),
    "tilt-60": (60.0, 0.0),
    "tilt-0": (0.0, 0.0),
    "tilt-50-a20": (50.0, 20.0),
    "tilt-50-c20": (50.0, -20.0),
}
"""Angle to the vertical, and azimuth from the radial direction [deg] (Chen et al.
2025, table III)."""

TASKS: dict[str, Callable[[ArmSpec], Task]] = {
    "circle": circle,
    **{
        name: partial(tilt, name=name, angle_deg=angle, turned_deg=azimuth)
        for name, (angle, azimuth) in TILTS.items()
    },
    "hold-base": hold_base,
    **{name: partial(hold_and_turn, name=name) for name in HELD},
    **{name: partial(reach, name=name) for name in REACH},
    "flee": flee,
    "follow": follow,
    **{name: partial(path, name=name) for name in PATHS},
}
"""Tasks of the package, by name: functions of the arm."""


PACE = "@"
MAX_PACE = 100.0
"""Largest factor of a pace, and of its inverse: a circle then takes half an hour."""


def paced_task(name: str, arm: ArmSpec, pace: float) -> Task:
    """Return a task at another pace: 0.5 takes twice the time.

    Args:
        name: of a task, as in `load_task`.
        arm: the arm.
        pace: times the usual pace.

    Raises:
        TargetError: as `load_task`, or the pace is out of range.
    """
    if not 1 / MAX_PACE <= pace <= MAX_PACE:
        raise TargetError(
            f"a pace of {pace:g} was given; give {1 / MAX_PACE:g} to {MAX_PACE:g}, such as "
            "0.5 for half as fast"
        )
    slower = arm.model_copy(update={"control_rate": arm.control_rate / pace})
    return load_task(name, slower)


def load_task(name: str, arm: ArmSpec) -> Task:
    """Return a task for an arm.

    Args:
        name: one of `TASKS`, a file of waypoints or of a curve (.csv), or a custom
            function (`file.py:function`) that takes the arm; a pace may follow, such as
            `square@0.5`.
        arm: the arm.

    Raises:
        TargetError: no such task, an invalid file, or a custom function that
            fails, returns no task, or goals that are none for the arm
            (`Task.check`).
    """
    if not isinstance(name, str):
        raise TargetError(
            f"a task was given as {type(name).__name__}, whose goals are made already; "
            "give its name, a file of waypoints, or file.py:function"
        )
    base, pace = split_pace(name)
    if pace is not None:
        return replace(paced_task(base, arm, pace), name=name)
    if name.endswith(".csv"):
        return table_task(name, arm)
    trust_code(name)
    try:
        build = resolve("task", name, TASKS)
    except S2C2AError as error:
        raise TargetError(f"{error}, or a file of waypoints ending in .csv") from error
    with named_errors(TargetError, f"the task '{name}' cannot be made for {arm.name}"):
        task = build(arm)
    if not isinstance(task, Task):
        raise TargetError(
            f"the task '{name}' made {task!r}; its function takes an arm and returns a "
            "Task"
        )
    task.check(arm)
    return task


def split_pace(name: str) -> tuple[str, float | None]:
    """The name of a task without its pace, and the pace; None if it has none."""
    base, separator, pace = name.rpartition(PACE)
    if not separator:
        return name, None
    try:
        return base, float(pace)
    except ValueError:
        return name, None
