"""Reaching a target past obstacles, and fleeing from one (Chen et al. 2025, secs. IV-E and IV-F)."""

from collections.abc import Sequence

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.planning import Goal
from s2c2a.tasks.paths import PAPER_LENGTH, still, straight
from s2c2a.tasks.task import Score, Task

Obstacle = tuple[float, float, float, float]
"""Centre and threshold r [m], for an arm of 0.6 m."""

TARGET, SPEED, TIME = (0.30, 0.0, 0.49), 0.05, 24.0  # m, m/s, s
REACH: dict[str, Sequence[Obstacle]] = {
    "reach-0": (),
    "reach-1": ((0.16, 0.02, 0.55, 0.06),),
    "reach-2": ((0.16, 0.02, 0.55, 0.06), (0.21, -0.03, 0.52, 0.04)),
    "risk-a": ((0.16, -0.07, 0.56, 0.11), (0.16, 0.07, 0.56, 0.03)),
    "risk-b": ((0.16, -0.07, 0.56, 0.11), (0.16, 0.07, 0.56, 0.11)),
    "risk-c": ((0.16, -0.07, 0.56, 0.03), (0.16, 0.07, 0.56, 0.11)),
}
CLEARANCES = (Score("clearance"), Score("clearance at steps"), Score("clearance of the arm"))
FLEE_RADIUS, FLEE_SIDE, FLEE_HEIGHT = 0.10, 0.02, 0.58  # m
FLEE_STOPS = (0.25, 0.08, -0.07)  # x [m]
FLEE_WAITS = (1.0, 2.0, 2.0)  # s


def reach(arm: ArmSpec, name: str) -> Task:
    """Follow a reference straight to a target, past obstacles. mu_p = 1, mu_d = 0.5, mu_ob = 1."""
    scale, rate = arm.length / PAPER_LENGTH, arm.control_rate
    line = straight((0.0, 0.0, PAPER_LENGTH), TARGET, SPEED, rate)
    path = np.concatenate([line, still(TARGET, max(TIME - len(line) / rate, 1.0), rate)])
    obstacles = scale * np.array(REACH[name]).reshape(-1, 4)
    rest = Goal.of(arm.module_count, change_weight=0.5).with_obstacles(obstacles[:, :3], obstacles[:, 3])
    goals = tuple(rest.with_position(scale * position, weight=1.0) for position in path)
    clearances = CLEARANCES if len(obstacles) else ()
    return Task(name, goals, (Score("end distance"), Score("reached"), *clearances, Score("path length")))


def flee(arm: ArmSpec) -> Task:
    """Nothing is asked but to stay out of an obstacle that comes near, twice. mu_p = 0, mu_d = 0.5, mu_ob = 1."""
    scale, rate = arm.length / PAPER_LENGTH, arm.control_rate
    points = [np.array([x, FLEE_SIDE, FLEE_HEIGHT]) for x in FLEE_STOPS]
    pieces = [still(points[0], FLEE_WAITS[0], rate)]
    for before, after, wait in zip(points, points[1:], FLEE_WAITS[1:], strict=False):
        pieces += [straight(before, after, SPEED, rate), still(after, wait, rate)]
    rest = Goal.of(arm.module_count, change_weight=0.5)
    centres = scale * np.concatenate(pieces)
    goals = tuple(rest.with_obstacles(centre[None], [scale * FLEE_RADIUS]) for centre in centres)
    return Task("flee", goals, (*CLEARANCES, Score("stillness"), Score("path length")))
