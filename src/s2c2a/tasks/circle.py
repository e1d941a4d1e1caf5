"""Tasks with an approach and one revolution (Chen et al. 2025, secs. IV-B to IV-D).

The tip follows a circle, or the axis of one module's end turns around the vertical.
Lengths scale with the arm; times are in seconds.
"""

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import directions_at
from s2c2a.errors import TargetError
from s2c2a.planning import Goal
from s2c2a.tasks.task import PAPER_LENGTH, Path, Score, Task

# s; the protocol (docs/results/protocol.md)
APPROACH_TIME = 4.0
ROUND_TIME = 16.0
HELD = {"hold-middle": (0.396 / 0.4, 20.0, 3), "hold-end": (0.565 / 0.6, 40.0, 2)}
"""Height of the held end over its height at rest, tilt of its axis [deg], and minimum
number of modules."""

Steps = Float[np.ndarray, " steps"]


def circle_path(
    length: float, control_rate: float, radius: float = 0.22, height: float = 0.54
) -> Path:
    """Tip positions [m], base frame: an approach, then one counterclockwise circle.

    Args:
        length: of the arm [m].
        control_rate: steps per second [Hz].
        radius: of the circle on an arm of 0.6 m [m].
        height: of the circle on an arm of 0.6 m [m].
    """
    end = np.array([radius, 0.0, height]) / PAPER_LENGTH
    approach = approach_path(end, control_rate)
    angles = _approach_and_turn(control_rate)[1][len(approach) :]
    lateral = end[0] * directions_at(angles)
    turn = np.column_stack([lateral, np.full(len(angles), end[2])])
    return length * np.concatenate([approach, turn])


def circle(arm: ArmSpec) -> Task:
    """Follow a circle with the tip. Weights: mu_p = 1, mu_d = 0.5."""
    path = circle_path(arm.length, arm.control_rate)
    return Task.along("circle", path, Goal.of(arm.module_count))


def tilt(arm: ArmSpec, name: str, angle_deg: float, turned_deg: float = 0.0) -> Task:
    """The circle with a tilted tip axis. Weights: mu_p = 1, mu_o = 2, mu_d = 0.5.

    Args:
        arm: the arm.
        name: of the task.
        angle_deg: angle between tip axis and vertical on the circle; it grows linearly
            during the approach.
        turned_deg: azimuth of the axis, counterclockwise from the radial direction.
    """
    shares, angles = _approach_and_turn(arm.control_rate)
    tilts = np.deg2rad(angle_deg) * shares
    axes = _tilted_axes(tilts, angles + np.deg2rad(turned_deg))
    goals = tuple(
        goal.with_axis(axis, weight=2.0)
        for goal, axis in zip(circle(arm).goals, axes, strict=True)
    )
    scores = [Score("position"), Score("tilt")]
    if turned_deg:
        scores.append(Score("azimuth", steps=angles > 0))
    return Task(name, goals, tuple(scores))


def hold_base(arm: ArmSpec) -> Task:
    """Hold the end of the base module while the tip follows a circle.

    On an arm of 0.6 m, the circle has a radius of 0.15 m and a height of 0.56 m.
    Weights: mu_p = 1 at the tip, mu_p = 4 at the base module, mu_d = 0.5. With mu_p = 1
    at the base, even a perfect model leaves 1.9 cm (docs/results/protocol.md).

    Raises:
        TargetError: the arm has one module.
    """
    _check_modules("hold-base", arm, 2)
    position = np.array([0.0, 0.0, ArmGeometry.of(arm).lengths[0]])
    goal = Goal.of(arm.module_count)
    goal = goal.with_position(position, weight=4.0, module=0)
    path = circle_path(arm.length, arm.control_rate, radius=0.15, height=0.56)
    scores = Score("constraint", module=0), Score("position")
    return Task.along("hold-base", path, goal, *scores)


def hold_and_turn(arm: ArmSpec, name: str) -> Task:
    """Hold one module's end on the vertical axis while its own axis turns around it.

    Weights: mu_p = mu_o = 1, mu_d = 0.5.

    Args:
        arm: the arm.
        name: one of `HELD`: the middle module or the last one.

    Raises:
        TargetError: the arm has too few modules.
    """
    height_ratio, tilt_deg, min_modules = HELD[name]
    _check_modules(name, arm, min_modules)
    module = arm.module_count - 1
    if name == "hold-middle":
        module //= 2
    shares, angles = _approach_and_turn(arm.control_rate)
    height_at_rest = ArmGeometry.of(arm).lengths[: module + 1].sum()
    heights = height_at_rest * (1 - (1 - height_ratio) * shares)
    axes = _tilted_axes(np.deg2rad(tilt_deg) * shares, angles)
    goals = []
    for height, axis in zip(heights, axes, strict=True):
        goal = Goal.of(arm.module_count)
        goal = goal.with_position([0.0, 0.0, height], module=module)
        goals.append(goal.with_axis(axis, weight=1.0, module=module))
    scores = Score("constraint", module=module), Score("orientation", module=module)
    return Task(name, tuple(goals), scores)


def approach_path(end: Float[np.ndarray, "3"], control_rate: float) -> Path:
    """Approach along arcs of equal bends to a point; for an arm of length one.

    The arc ends near the height of the point; the difference is distributed over the
    approach.
    """
    steps = max(1, round(APPROACH_TIME * control_rate))
    shares = np.arange(1, steps + 1) / steps
    lateral = np.asarray(end[:2])
    distance = np.linalg.norm(lateral)
    heights = np.array([_arc_height(float(distance * share)) for share in shares])
    return np.column_stack(
        [shares[:, None] * lateral, heights + (end[2] - heights[-1]) * shares]
    )


def _approach_and_turn(control_rate: float) -> tuple[Steps, Steps]:
    """Share of the approach and azimuth of the turn [rad], after every step."""
    approach = max(1, round(APPROACH_TIME * control_rate))
    turn = max(1, round(ROUND_TIME * control_rate))
    shares = np.concatenate([np.arange(1, approach + 1) / approach, np.ones(turn)])
    angles = 2 * np.pi * np.arange(1, turn + 1) / turn
    return shares, np.concatenate([np.zeros(approach), angles])


def _tilted_axes(tilts: Steps, azimuths: Steps) -> Float[np.ndarray, "steps 3"]:
    """Unit vectors with these angles to the vertical and azimuths [rad]."""
    lateral = np.sin(tilts)[:, None] * directions_at(azimuths)
    return np.column_stack([lateral, np.cos(tilts)])


def _arc_height(distance: float) -> float:
    """Height of the end of an arc of length one with this lateral distance."""
    from scipy.optimize import brentq  # noqa: PLC0415 (slow import)

    angle = brentq(lambda f: (1 - np.cos(f)) / f - distance, 1e-9, 2.0)
    return float(np.sin(angle) / angle)


def _check_modules(name: str, arm: ArmSpec, least: int) -> None:
    if arm.module_count < least:
        raise TargetError(
            f"the task '{name}' needs an arm of at least {least} modules, "
            f"'{arm.name}' has {arm.module_count}; choose another task"
        )
