"""The circle of the paper's position control, and with wanted orientations (Chen et al. 2025, secs. IV-B and IV-C)."""

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.planning import Goal
from s2c2a.tasks.paths import PAPER_LENGTH, Path, approach_shares, out_and_around, round_angles, tilted_axes
from s2c2a.tasks.task import Score, Task

RADIUS, HEIGHT = 0.22 / PAPER_LENGTH, 0.54 / PAPER_LENGTH


def circle_path(length: float, control_rate: float) -> Path:
    """Wanted tip positions [m], base frame: out along the arc of equal bends, then once around, anticlockwise.

    Args:
        length: of the arm [m].
        control_rate: steps a second [Hz].
    """
    return length * out_and_around(RADIUS, HEIGHT, control_rate)


def circle(arm: ArmSpec) -> Task:
    """Follow a circle with the tip; lengths scale with the arm. Weights mu_p = 1, mu_d = 0.5."""
    rest = Goal.of(arm.module_count, change_weight=0.5)
    path = circle_path(arm.length, arm.control_rate)
    return Task("circle", tuple(rest.with_position(position, weight=1.0) for position in path))


def tilt(arm: ArmSpec, name: str, angle_deg: float, turned_deg: float = 0.0) -> Task:
    """The circle with the tip tilted from the vertical, radially or turned from it. mu_p = 1, mu_o = 2, mu_d = 0.5.

    Args:
        arm: the arm.
        name: of the task.
        angle_deg: between the end axis and the vertical once the circle begins; it grows evenly in the approach.
        turned_deg: anticlockwise, from the radial direction.
    """
    share, angle = approach_shares(arm.control_rate), round_angles(arm.control_rate)
    tilts = np.deg2rad(angle_deg) * np.concatenate([share, np.ones_like(angle)])
    azimuths = np.concatenate([np.zeros_like(share), angle]) + np.deg2rad(turned_deg)
    axes = tilted_axes(tilts, azimuths)
    goals = zip(circle(arm).goals, axes, strict=True)
    after_approach = np.arange(len(axes)) >= len(share)
    scores: tuple[Score, ...] = (Score("position"), Score("tilt"))
    if turned_deg:
        scores = (*scores, Score("azimuth", steps=after_approach))
    return Task(name, tuple(goal.with_axis(axis, weight=2.0) for goal, axis in goals), scores)
