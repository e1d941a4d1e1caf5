"""Targets and obstacles that go along lines (Chen et al. 2025, secs. IV-E and IV-F): reach, flee, follow.

Numbers are for an arm of `PAPER_LENGTH`; the tasks scale with the arm.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.planning import Goal, reach_gaps
from s2c2a.tasks.task import PAPER_LENGTH, Path, Score, Task

Obstacle = tuple[float, float, float, float]
"""Center and threshold r [m], for an arm of 0.6 m."""

# m, m/s, s
TARGET = (0.30, 0.0, 0.49)
SPEED = 0.05
TIME = 24.0
REACH: dict[str, Sequence[Obstacle]] = {
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
# m
FLEE_RADIUS = 0.10
FLEE_SIDE = 0.02
FLEE_HEIGHT = 0.58
FLEE_STOPS = (0.25, 0.08, -0.07)  # x [m]
FLEE_WAITS = (1.0, 2.0, 2.0)  # s

# s
LINE_TIME = 5.0
WANDER_TIME = 48.0
WAIT_OUTSIDE = 2.0
HOLD_TIME = 4.0
# m, m/s
OUTSIDE = (0.60, 0.0, 0.45)
OUTWARD_SPEED = 0.08
WITHIN_REACH = 0.01  # m, for an arm of 0.6 m: a constant-curvature arm gets so near
SETTLING_TIME = 1.5  # s after re-entry that are scored as recovery, not as following


def reach(arm: ArmSpec, name: str) -> Task:
    """Follow a reference straight to a target, past obstacles. mu_p = 1, mu_d = 0.5, mu_ob = 1."""
    scale = arm.length / PAPER_LENGTH
    rate = arm.control_rate
    line = straight((0.0, 0.0, PAPER_LENGTH), TARGET, SPEED, rate)
    path = np.concatenate(
        [line, still(TARGET, max(TIME - len(line) / rate, 1.0), rate)]
    )
    obstacles = scale * np.array(REACH[name]).reshape(-1, 4)
    rest = Goal.of(arm.module_count).with_obstacles(obstacles[:, :3], obstacles[:, 3])
    clearances = CLEARANCES if len(obstacles) else ()
    return Task.along(
        name,
        scale * path,
        rest,
        Score("end distance"),
        Score("reached"),
        *clearances,
        Score("path length"),
    )


def flee(arm: ArmSpec) -> Task:
    """Nothing is asked but to stay out of an obstacle that comes near, twice. mu_p = 0, mu_d = 0.5, mu_ob = 1."""
    scale = arm.length / PAPER_LENGTH
    rate = arm.control_rate
    points = [np.array([x, FLEE_SIDE, FLEE_HEIGHT]) for x in FLEE_STOPS]
    pieces = [still(points[0], FLEE_WAITS[0], rate)]
    for (before, after), wait in zip(pairwise(points), FLEE_WAITS[1:], strict=True):
        pieces += [straight(before, after, SPEED, rate), still(after, wait, rate)]
    rest = Goal.of(arm.module_count)
    goals = (
        rest.with_obstacles(center[None], [scale * FLEE_RADIUS])
        for center in scale * np.concatenate(pieces)
    )
    return Task(
        "flee", tuple(goals), (*CLEARANCES, Score("stillness"), Score("path length"))
    )


def follow(arm: ArmSpec) -> Task:
    """Chase a target that is moved by hand: about the workspace, out of it, and back. mu_p = 1, mu_d = 0.5."""
    scale = arm.length / PAPER_LENGTH
    rate = arm.control_rate
    path = scale * _hand_path(rate)
    inside = reach_gaps(arm, path) <= scale * WITHIN_REACH
    settled = inside & ~_just_back(inside, round(SETTLING_TIME * rate))
    settled[: round(LINE_TIME * rate)] = False
    scores = Score("position", steps=settled), Score("recovery", steps=inside)
    return Task.along("follow", path, Goal.of(arm.module_count), *scores)


def straight(start, end, speed: float, control_rate: float) -> Path:
    """From a point to another at a constant speed [m/s], the end included, the start not."""
    start = np.asarray(start, dtype=float)
    end = np.asarray(end, dtype=float)
    steps = max(1, round(float(np.linalg.norm(end - start)) / speed * control_rate))
    return start + (end - start) * np.arange(1, steps + 1)[:, None] / steps


def still(point, time: float, control_rate: float) -> Path:
    """Staying at a point for some time [s]."""
    return np.tile(np.asarray(point, dtype=float), (round(time * control_rate), 1))


def _hand_path(rate: float) -> np.ndarray:
    time = np.arange(1, round(WANDER_TIME * rate) + 1) / rate
    wander = _wander(time)
    begin = _wander(np.zeros(1))[0]
    rest = np.array([0.0, 0.0, PAPER_LENGTH])
    line = straight(rest, begin, float(np.linalg.norm(begin - rest)) / LINE_TIME, rate)
    out = straight(wander[-1], OUTSIDE, OUTWARD_SPEED, rate)
    back = straight(OUTSIDE, wander[-1], OUTWARD_SPEED, rate)
    pieces = [
        line,
        wander,
        out,
        still(OUTSIDE, WAIT_OUTSIDE, rate),
        back,
        still(back[-1], HOLD_TIME, rate),
    ]
    return np.concatenate(pieces)


def _wander(time: np.ndarray) -> np.ndarray:
    x = 0.18 + 0.08 * np.sin(2 * np.pi * time / 12)
    y = 0.18 * np.sin(2 * np.pi * time / 24)
    return np.stack([x, y, 0.58 - 1.2 * (x**2 + y**2)], axis=-1)


def _just_back(inside: np.ndarray, steps: int) -> np.ndarray:
    """The first steps after every re-entry."""
    entries = np.flatnonzero(inside[1:] & ~inside[:-1]) + 1
    just = np.zeros_like(inside)
    for entry in entries:
        just[entry : entry + steps] = True
    return just
