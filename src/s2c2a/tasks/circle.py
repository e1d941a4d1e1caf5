"""The circle of the paper's position control (Chen et al. 2025, sec. IV-B), as the protocol fixes it."""

import numpy as np
from jaxtyping import Float
from scipy.optimize import brentq

from s2c2a.arm import ArmSpec
from s2c2a.planning import Goal
from s2c2a.tasks.task import Task

APPROACH_TIME, ROUND_TIME = 4.0, 16.0  # s
RADIUS, HEIGHT = 0.22 / 0.6, 0.54 / 0.6  # of the arm's length


def circle(arm: ArmSpec) -> Task:
    """Follow a circle with the tip; lengths scale with the arm. Weights mu_p = 1, mu_d = 0.5."""
    rest = Goal.of(arm.module_count, change_weight=0.5)
    path = circle_path(arm.length, arm.control_rate)
    return Task("circle", tuple(rest.with_position(position, weight=1.0) for position in path))


def circle_path(length: float, control_rate: float) -> Float[np.ndarray, "steps 3"]:
    """Wanted tip positions [m], base frame: out along the arc of equal bends, then once around, anticlockwise.

    Args:
        length: of the arm [m].
        control_rate: steps a second [Hz].
    """
    steps = round(APPROACH_TIME * control_rate)
    share = np.arange(1, steps + 1) / steps
    height = np.array([arc_height(RADIUS * part) for part in share])
    height += (HEIGHT - height[-1]) * share  # the last arc ends near the circle's height; the rest is spread
    way_out = np.stack([RADIUS * share, np.zeros(steps), height], axis=-1)
    steps = round(ROUND_TIME * control_rate)
    angle = 2 * np.pi * np.arange(1, steps + 1) / steps
    around = np.stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), np.full(steps, HEIGHT)], axis=-1)
    return length * np.concatenate([way_out, around])


def arc_height(reach: float) -> float:
    """Height of the end of an arc of length one that reaches so far aside."""
    angle = brentq(lambda f: (1 - np.cos(f)) / f - reach, 1e-9, 2.0)
    return float(np.sin(angle) / angle)
