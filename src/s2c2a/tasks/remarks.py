"""Remarks on a task before the arm moves: what is allowed, and seldom meant."""

from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import listed
from s2c2a.obstacles import CENTER, CORE, THRESHOLD, distances, is_half_space
from s2c2a.planning import SIGNIFICANT, reach_gaps
from s2c2a.tasks.task import Task

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
    if by_arcs and task.foreseen:
        for module in np.flatnonzero(np.isfinite(desired).any(axis=(0, 2))):
            yield from _out_of_reach(desired[:, module], times, int(module), arm)
    heights = desired[np.isfinite(desired[..., 2]), 2]
    if len(heights) and (heights < 0.0).all():
        yield f"all targets have z < 0, behind the base: {BEHIND}"
    if (hours := times[-1] / 3600.0) >= 1:
        yield (
            f"the task takes {hours:.1f} hours; columns of times are in seconds, unless "
            "their name has another unit, such as `time [ms]`"
        )
    if any(goal.thresholds.any() for goal in task.goals):
        yield from _odd_obstacles(task.obstacles(), arm)


def time_spans(is_wanted: Bool[np.ndarray, " steps"], times: Sequence[float]) -> str:
    """Times as text, successive ones together, such as "3 to 12 s"."""
    spans = []
    for wanted, group in groupby(
        zip(is_wanted, times, strict=True), lambda pair: pair[0]
    ):
        (_, first), *rest = group
        if wanted:
            spans.append(f"{first:g} to {rest[-1][1]:g}" if rest else f"{first:g}")
    return f"{listed(spans)} s"


def _out_of_reach(
    positions: Float[np.ndarray, "steps 3"],
    times: Float[np.ndarray, " steps"],
    module: int,
    arm: ArmSpec,
) -> Iterator[str]:
    points, which = np.unique(positions, axis=0, return_inverse=True)
    gaps = reach_gaps(arm, points, module)[which]  # NaN without a target
    is_far = gaps > SIGNIFICANT * arm.length
    if is_far.any():
        is_tip = module == arm.module_count - 1
        end = "the tip" if is_tip else f"the end of module {module + 1}"
        yield (
            f"out of reach by up to {100.0 * gaps[is_far].max():.2f} cm, if modules bend "
            f"as arcs: targets of {end} in {is_far.sum()} of {len(times)} steps, at "
            f"{time_spans(is_far, times.tolist())}"
        )


def _odd_obstacles(
    rows: Float[np.ndarray, "steps obstacles 12"], arm: ArmSpec
) -> Iterator[str]:
    """Obstacles that contain the tip at rest, and those beyond the arm or behind it."""
    is_there = rows[..., THRESHOLD] > 0.0

    def gaps(points: np.ndarray) -> Float[np.ndarray, "steps obstacles"]:
        from_cores = distances(points, rows[..., CENTER], rows[..., CORE])
        return np.where(is_there, from_cores - rows[..., THRESHOLD], np.nan)

    # from so far above, all points of an obstacle lie in one direction
    tops = 1e9 - gaps(rows[..., CENTER] * [1.0, 1.0, 0.0] + [0.0, 0.0, 1e9])
    far = (gaps(np.zeros(3)) > arm.length) | (tops < 0.0) | ~is_there
    # walls and tables are described wherever they are
    are_solids = [not is_half_space(row) for row in rows[0]]
    far = far.all(axis=0) & is_there.any(axis=0) & are_solids
    within = gaps(np.array([0.0, 0.0, arm.length]))[0] < 0.0
    texts = {f"beyond the arm's reach or behind its base: {BEHIND}": far}
    texts["where the tip is at rest"] = within
    for text, are in texts.items():
        if are.any():
            numbers = listed([str(number) for number in np.flatnonzero(are)])
            yield f"obstacle {numbers} (counted from 0) is {text}"
