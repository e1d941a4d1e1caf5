"""Targets and obstacles on straight lines (Chen et al. 2025, secs. IV-E and IV-F).

The tasks are reach, flee and follow. Lengths are for an arm of `PAPER_LENGTH`, and
scale with the arm.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.planning import Goal, reach_gaps
from s2c2a.runtime.border import check_meters
from s2c2a.tasks.task import PAPER_LENGTH, Path, Score, Task

Sphere = tuple[float, float, float, float]
"""Center and threshold r [m], for an arm of 0.6 m."""
Point = Sequence[float]
"""Three numbers, as `Goal.with_position` and `Goal.with_axis` check."""

REACH_TARGET = (0.30, 0.0, 0.49)  # m
# the protocol (docs/results/protocol.md), as all places and times below
SPEED = 0.05  # m/s; of targets and of the obstacle of `flee`
REACH: dict[str, Sequence[Sphere]] = {
    "reach-0": (),
    "reach-1": ((0.16, 0.02, 0.55, 0.06),),
    "reach-2": ((0.16, 0.02, 0.55, 0.06), (0.21, -0.03, 0.52, 0.04)),
    "risk-a": ((0.16, -0.07, 0.56, 0.11), (0.16, 0.07, 0.56, 0.03)),
    "risk-b": ((0.16, -0.07, 0.56, 0.11), (0.16, 0.07, 0.56, 0.11)),
    "risk-c": ((0.16, -0.07, 0.56, 0.03), (0.16, 0.07, 0.56, 0.11)),
}
CLEARANCES = (
    Score("clearance"),
    Score("clearance at steps"),
    Score("clearance of the arm"),
)

FLEE_STOPS = ((0.25, 0.02, 0.58), (0.08, 0.02, 0.58), (-0.07, 0.02, 0.58))  # m
FLEE_WAITS = (1.0, 2.0, 2.0)  # s

POINT_TIME = 15.0  # s; chosen: a way around obstacles, and time to settle

FOLLOW_APPROACH = 5.0  # s; `follow` is not scored meanwhile
OUTSIDE = (0.60, 0.0, 0.45)  # m; out of reach


def reach(arm: ArmSpec, name: str) -> Task:
    """Follow a straight line to a target in 24 s, past obstacles.

    Weights: mu_p = 1, mu_d = 0.5, mu_ob = 1.
    """
    scale = arm.length / PAPER_LENGTH
    rate = arm.control_rate
    line = straight((0.0, 0.0, PAPER_LENGTH), REACH_TARGET, SPEED, rate)
    wait = max(24.0 - len(line) / rate, 1.0)
    path = scale * np.concatenate([line, still(REACH_TARGET, wait, rate)])
    obstacles = scale * np.array(REACH[name]).reshape(-1, 4)
    goal = Goal.of(arm.module_count).with_obstacles(obstacles[:, :3], obstacles[:, 3])
    scores = [Score("end distance"), Score("reached")]
    if len(obstacles):
        scores += CLEARANCES
    return Task.along(name, path, goal, *scores, Score("path length"))


def to_point(arm: ArmSpec, position: Point, axis: Point | None = None) -> Task:
    """Go to a point, and stay there.

    Args:
        arm: the arm.
        position: of the tip [m], base frame.
        axis: of the tip there, base frame, of any length.

    Raises:
        TargetError: see `goal_at`.
    """
    goal = goal_at(arm, position, axis)
    steps = round(POINT_TIME * arm.control_rate)
    scores = Score("end distance"), Score("path length")
    return Task("point", (goal,) * max(steps, 1), scores)


def goal_at(
    arm: ArmSpec, position: Point, axis: Point | None = None, module: int = -1
) -> Goal:
    """The goal of one point of a module's end.

    Raises:
        TargetError: the point is too far away for meters, or as `Goal.with_position` and
            `Goal.with_axis`.
    """
    goal = Goal.of(arm.module_count).with_position(position, module=module)
    check_meters(goal.positions, arm, "the target")
    return goal if axis is None else goal.with_axis(axis, module=module)


def flee(arm: ArmSpec) -> Task:
    """Avoid an obstacle of 0.1 m that approaches twice, without a target.

    Weights: mu_p = 0, mu_d = 0.5, mu_ob = 1.
    """
    scale = arm.length / PAPER_LENGTH
    rate = arm.control_rate
    pieces = [still(FLEE_STOPS[0], FLEE_WAITS[0], rate)]
    for (start, end), wait in zip(pairwise(FLEE_STOPS), FLEE_WAITS[1:], strict=True):
        pieces += [straight(start, end, SPEED, rate), still(end, wait, rate)]
    rest = Goal.of(arm.module_count)
    goals = tuple(
        rest.with_obstacles(center[None], [scale * 0.1])
        for center in scale * np.concatenate(pieces)
    )
    scores = (*CLEARANCES, Score("stillness"), Score("path length"))
    return Task("flee", goals, scores)


def follow(arm: ArmSpec) -> Task:
    """Follow a target that a hand moves through the workspace, out of it and back.

    Targets within 1 cm of the workspace of constant curvature (of an arm of 0.6 m) are
    scored: the first 1.5 s after the way back as recovery, the others as following.
    Weights: mu_p = 1, mu_d = 0.5.
    """
    scale = arm.length / PAPER_LENGTH
    rate = arm.control_rate
    # a way to the dome, 48 s on it, a way out at 0.08 m/s and back, and 4 s of rest
    time = np.arange(1, max(1, round(48.0 * rate)) + 1) / rate
    wander = _wander(time)
    start = _wander(np.zeros(1))[0]
    rest = np.array([0.0, 0.0, PAPER_LENGTH])
    approach_speed = float(np.linalg.norm(start - rest)) / FOLLOW_APPROACH
    back = straight(OUTSIDE, wander[-1], 0.08, rate)
    pieces = [
        straight(rest, start, approach_speed, rate),
        wander,
        straight(wander[-1], OUTSIDE, 0.08, rate),
        still(OUTSIDE, 2.0, rate),
        back,
        still(back[-1], 4.0, rate),
    ]
    path = scale * np.concatenate(pieces)
    inside = reach_gaps(arm, path) <= scale * 0.01
    steps = round(1.5 * rate)
    after_reentry = np.zeros_like(inside)
    for entry in np.flatnonzero(inside[1:] & ~inside[:-1]) + 1:
        after_reentry[entry : entry + steps] = True
    following = inside & ~after_reentry
    following[: round(FOLLOW_APPROACH * rate)] = False
    scores = Score("position", steps=following), Score("recovery", steps=inside)
    task = Task.along("follow", path, Goal.of(arm.module_count), *scores)
    return replace(task, foreseen=False)


def straight(start, end, speed: float, control_rate: float) -> Path:
    """Line at constant speed [m/s]; it includes the end point, not the start."""
    start = np.asarray(start, dtype=float)
    end = np.asarray(end, dtype=float)
    steps = max(1, round(float(np.linalg.norm(end - start)) / speed * control_rate))
    return start + (end - start) * np.arange(1, steps + 1)[:, None] / steps


def still(point, time: float, control_rate: float) -> Path:
    """Constant position for some time [s]."""
    return np.tile(np.asarray(point, dtype=float), (round(time * control_rate), 1))


def _wander(time: np.ndarray) -> np.ndarray:
    """Smooth path on a dome [m]."""
    x = 0.18 + 0.08 * np.sin(2 * np.pi * time / 12)
    y = 0.18 * np.sin(2 * np.pi * time / 24)
    return np.stack([x, y, 0.58 - 1.2 * (x**2 + y**2)], axis=-1)
