"""Remarks on a task before the arm moves: what is allowed, and seldom meant."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import name_of_end
from s2c2a.errors import listed
from s2c2a.obstacles import CENTER, CORE, THRESHOLD, distances, is_half_space
from s2c2a.tasks.task import Task
from s2c2a.tasks.waypoints import Waypoints, unreachable_waypoints

MOMENTS = 1000  # of a path at most: some seconds with trained networks, on two cores
BEHIND = "z grows from the base toward the tip at rest, also on a hanging arm"


def remarks(task: Task, arm: ArmSpec, by_arcs: bool = True) -> Iterator[str]:
    """Sentences on targets out of reach, long durations and odd obstacles.

    Args:
        task: any.
        arm: that shall do it.
        by_arcs: whether targets are compared with the reach of constant-curvature arcs.
            Those that the arm does not know ahead may lead out of it.
    """
    desired = task.desired_positions()
    times = (np.arange(len(desired)) + 1) / arm.control_rate
    stride = -(-len(times) // MOMENTS)
    is_given = np.isfinite(desired).all(axis=-1)
    for module in np.flatnonzero(is_given.any(axis=0) & by_arcs & task.foreseen):
        positions = desired[::stride, module]
        track = Waypoints(int(module), times[::stride], positions, None)
        far = unreachable_waypoints([track], arm)
        if far:
            gap = 100.0 * max(point.gap for point in far)
            is_far = np.isin(track.times, [point.time for point in far])
            is_far = is_far.repeat(stride)[: len(times)]
            yield (
                f"out of reach by up to {gap:.2f} cm, if modules bend as arcs: targets "
                f"of the {name_of_end(arm, int(module))} at {time_spans(is_far, arm)}"
            )
    if is_given.any() and (desired[is_given][:, 2] < 0.0).all():
        yield f"all targets have z < 0, behind the base: {BEHIND}"
    if (hours := times[-1] / 3600.0) >= 1:
        yield (
            f"the task takes {hours:.1f} hours; columns of times are in seconds, unless "
            "their name has another unit, such as `time [ms]`"
        )
    yield from _odd_obstacles(task, arm)


def time_spans(is_wanted: Bool[np.ndarray, " steps"], arm: ArmSpec) -> str:
    """Times after control steps as text, successive ones together: "3 to 12 s"."""
    steps = np.flatnonzero(is_wanted)
    parts = np.split(steps, np.flatnonzero(np.diff(steps) > 1) + 1)
    ends = [(part[[0, -1]] + 1) / arm.control_rate for part in parts]
    spans = [" to ".join(f"{time:g}" for time in np.unique(end)) for end in ends]
    return f"{listed(spans)} s"


def _odd_obstacles(task: Task, arm: ArmSpec) -> Iterator[str]:
    """Obstacles that contain the tip at rest, and those beyond the arm or behind it."""
    rows = task.obstacles()
    names = np.array(task.obstacle_names())
    # walls and tables are described wherever they are
    are_solids = np.array([not is_half_space(row) for row in rows[0]], bool)
    # of what is absent, no comparison is true
    thresholds = np.where(rows[..., THRESHOLD] > 0.0, rows[..., THRESHOLD], np.nan)

    def gaps(points: np.ndarray) -> Float[np.ndarray, "steps obstacles"]:
        return distances(points, rows[..., CENTER], rows[..., CORE]) - thresholds

    # from so far above, all points of an obstacle lie in one direction
    height = 1e9
    above = rows[..., CENTER] * [1.0, 1.0, 0.0] + [0.0, 0.0, height]
    is_near = (gaps(np.zeros(3)) <= arm.length) & (gaps(above) <= height)
    far = ~is_near.any(axis=0) & are_solids
    within = gaps(np.array([0.0, 0.0, arm.length]))[0] < 0.0
    for name in dict.fromkeys(names):
        is_named = names == name
        if far[is_named].all():
            yield f"{name} is beyond the arm's reach or behind its base, in meters: {BEHIND}"
        elif within[is_named].any():
            yield f"{name} is where the tip is at rest"
