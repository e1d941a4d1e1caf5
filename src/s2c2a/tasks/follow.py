"""A target moved by hand: about the workspace, out of it, and back (Chen et al. 2025, sec. IV-F)."""

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.planning import Goal, reach_gaps
from s2c2a.tasks.paths import PAPER_LENGTH, still, straight
from s2c2a.tasks.task import Score, Task

LINE_TIME, WANDER_TIME, WAIT_OUTSIDE, HOLD_TIME = 5.0, 48.0, 2.0, 4.0  # s
OUTSIDE, SPEED = (0.60, 0.0, 0.45), 0.08  # m, m/s
WITHIN_REACH = 0.01  # m, for an arm of 0.6 m: a constant-curvature arm gets so near
SETTLING_TIME = 1.5  # s after re-entry that are scored as recovery, not as following


def follow(arm: ArmSpec) -> Task:
    """Chase a moving target online. mu_p = 1, mu_d = 0.5."""
    scale, rate = arm.length / PAPER_LENGTH, arm.control_rate
    path = scale * _path(rate)
    inside = reach_gaps(arm, path) <= scale * WITHIN_REACH
    rest = Goal.of(arm.module_count, change_weight=0.5)
    goals = tuple(rest.with_position(position, weight=1.0) for position in path)
    settled = inside & ~_just_back(inside, round(SETTLING_TIME * rate))
    settled[: round(LINE_TIME * rate)] = False
    return Task("follow", goals, (Score("position", steps=settled), Score("recovery", steps=inside)))


def _path(rate: float) -> np.ndarray:
    time = np.arange(1, round(WANDER_TIME * rate) + 1) / rate
    wander = _wander(time)
    begin = _wander(np.zeros(1))[0]
    rest = np.array([0.0, 0.0, PAPER_LENGTH])
    line = straight(rest, begin, float(np.linalg.norm(begin - rest)) / LINE_TIME, rate)
    out = straight(wander[-1], OUTSIDE, SPEED, rate)
    back = straight(OUTSIDE, wander[-1], SPEED, rate)
    pieces = [line, wander, out, still(OUTSIDE, WAIT_OUTSIDE, rate), back, still(back[-1], HOLD_TIME, rate)]
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
