"""Tasks that go out and once around (Chen et al. 2025, secs. IV-B to IV-D): with the tip, or with the axis of one end.

Lengths scale with the arm; times are in seconds.
"""

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import TargetError
from s2c2a.planning import Goal
from s2c2a.tasks.task import PAPER_LENGTH, Path, Score, Task

APPROACH_TIME = 4.0
ROUND_TIME = 16.0
RADIUS = 0.22 / PAPER_LENGTH
HEIGHT = 0.54 / PAPER_LENGTH
# while the base is held
TIP_RADIUS = 0.15 / PAPER_LENGTH
TIP_HEIGHT = 0.56 / PAPER_LENGTH
BASE_WEIGHT = 4.0  # with 1 even a perfect model leaves 1.9 cm (docs/protocol.md)
HELD = {"hold-middle": (0.396 / 0.4, 20.0, 3), "hold-end": (0.565 / 0.6, 40.0, 2)}
"""Height of the held end as part of its height at rest, tilt of its axis [deg], and
modules that it takes."""


def circle_path(length: float, control_rate: float) -> Path:
    """Desired tip positions [m], base frame: out along the arc of equal bends, then once around, anticlockwise.

    Args:
        length: of the arm [m].
        control_rate: steps a second [Hz].
    """
    return length * _out_and_around(RADIUS, HEIGHT, control_rate)


def circle(arm: ArmSpec) -> Task:
    """Follow a circle with the tip; lengths scale with the arm. Weights mu_p = 1, mu_d = 0.5."""
    return Task.along(
        "circle", circle_path(arm.length, arm.control_rate), Goal.of(arm.module_count)
    )


def tilt(arm: ArmSpec, name: str, angle_deg: float, turned_deg: float = 0.0) -> Task:
    """The circle with the tip tilted from the vertical, radially or turned from it. mu_p = 1, mu_o = 2, mu_d = 0.5.

    Args:
        arm: the arm.
        name: of the task.
        angle_deg: between the end axis and the vertical once the circle begins; it
            grows evenly in the approach.
        turned_deg: anticlockwise, from the radial direction.
    """
    shares, angles = _approach_and_round(arm.control_rate)
    axes = _tilted_axes(np.deg2rad(angle_deg) * shares, angles + np.deg2rad(turned_deg))
    goals = (
        goal.with_axis(axis, weight=2.0)
        for goal, axis in zip(circle(arm).goals, axes, strict=True)
    )
    scores = [Score("position"), Score("tilt")]
    if turned_deg:
        scores.append(Score("azimuth", steps=angles > 0))
    return Task(name, tuple(goals), tuple(scores))


def hold_base(arm: ArmSpec) -> Task:
    """The base module's end stays; the tip goes once around. mu_p tip 1, mu_p base 4, mu_d 0.5.

    Raises:
        TargetError: an arm of one module.
    """
    _check_modules("hold-base", arm, 2)
    held = np.array([0.0, 0.0, ArmGeometry.of(arm).lengths[0]])
    rest = Goal.of(arm.module_count).with_position(held, weight=BASE_WEIGHT, module=0)
    path = arm.length * _out_and_around(TIP_RADIUS, TIP_HEIGHT, arm.control_rate)
    return Task.along(
        "hold-base", path, rest, Score("constraint", module=0), Score("position")
    )


def hold_and_turn(arm: ArmSpec, name: str) -> Task:
    """The end of the middle module or of the last stays on the axis while its own axis turns once around.

    mu_p = mu_o = 1, mu_d 0.5.

    Args:
        arm: the arm.
        name: one of `HELD`.

    Raises:
        TargetError: an arm of too few modules.
    """
    lowered, tilt_deg, least = HELD[name]
    _check_modules(name, arm, least)
    module = (arm.module_count - 1) // (2 if name == "hold-middle" else 1)
    shares, angles = _approach_and_round(arm.control_rate)
    heights = ArmGeometry.of(arm).lengths[: module + 1].sum() * (
        1 - (1 - lowered) * shares
    )
    rest = Goal.of(arm.module_count)
    axes = _tilted_axes(np.deg2rad(tilt_deg) * shares, angles)
    goals = (
        rest.with_position([0.0, 0.0, z], module=module).with_axis(
            axis, weight=1.0, module=module
        )
        for z, axis in zip(heights, axes, strict=True)
    )
    return Task(
        name,
        tuple(goals),
        (Score("constraint", module=module), Score("orientation", module=module)),
    )


def _approach_and_round(
    control_rate: float,
) -> tuple[Float[np.ndarray, " steps"], Float[np.ndarray, " steps"]]:
    """After every step: how much of the way out is done, and the angle around, anticlockwise seen from above [rad]."""
    out = round(APPROACH_TIME * control_rate)
    around = round(ROUND_TIME * control_rate)
    shares = np.concatenate([np.arange(1, out + 1) / out, np.ones(around)])
    return shares, np.concatenate(
        [np.zeros(out), 2 * np.pi * np.arange(1, around + 1) / around]
    )


def way_out(end: Float[np.ndarray, "3"], control_rate: float) -> Path:
    """Out along the arc of equal bends to a point beside or near the axis; for an arm of length one.

    The arc ends near that point's height; what is missing is spread over the way.
    """
    shares = np.arange(1, round(APPROACH_TIME * control_rate) + 1)[:, None] / round(
        APPROACH_TIME * control_rate
    )
    aside = np.asarray(end[:2])
    climb = np.array(
        [_arc_height(float(np.linalg.norm(aside) * share)) for share in shares[:, 0]]
    )
    return np.column_stack(
        [shares * aside, climb + (end[2] - climb[-1]) * shares[:, 0]]
    )


def _out_and_around(radius: float, height: float, control_rate: float) -> Path:
    """Out along the arc of equal bends, then once around at one height; for an arm of length one."""
    _, angles = _approach_and_round(control_rate)
    turning = angles[round(APPROACH_TIME * control_rate) :]
    around = np.stack(
        [
            radius * np.cos(turning),
            radius * np.sin(turning),
            np.full(len(turning), height),
        ],
        axis=-1,
    )
    return np.concatenate(
        [way_out(np.array([radius, 0.0, height]), control_rate), around]
    )


def _tilted_axes(
    tilts: Float[np.ndarray, " steps"], azimuths: Float[np.ndarray, " steps"]
) -> Float[np.ndarray, "steps 3"]:
    """Unit vectors tilted from the vertical towards an azimuth [rad]."""
    return np.stack(
        [
            np.sin(tilts) * np.cos(azimuths),
            np.sin(tilts) * np.sin(azimuths),
            np.cos(tilts),
        ],
        axis=-1,
    )


def _arc_height(reach: float) -> float:
    """Height of the end of an arc of length one that reaches so far aside."""
    from scipy.optimize import brentq

    angle = brentq(lambda f: (1 - np.cos(f)) / f - reach, 1e-9, 2.0)
    return float(np.sin(angle) / angle)


def _check_modules(name: str, arm: ArmSpec, least: int) -> None:
    if arm.module_count < least:
        raise TargetError(
            f"the task '{name}' needs an arm of at least {least} modules, '{arm.name}' has {arm.module_count}; "
            "choose another task"
        )
