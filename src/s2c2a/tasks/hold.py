"""One module's end stays where it is while something else moves (Chen et al. 2025, sec. IV-D)."""

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import TargetError
from s2c2a.planning import Goal
from s2c2a.tasks.paths import PAPER_LENGTH, approach_shares, out_and_around, round_angles, tilted_axes
from s2c2a.tasks.task import Score, Task

TIP_RADIUS, TIP_HEIGHT = 0.15 / PAPER_LENGTH, 0.56 / PAPER_LENGTH
HELD = {"hold-middle": (0.396 / 0.4, 20.0), "hold-end": (0.565 / 0.6, 40.0)}
"""Height of the held end as part of its height at rest, and tilt of its axis [deg]."""
BASE_WEIGHT = 4.0  # with 1 even a perfect model leaves 1.9 cm (docs/protocol.md)


def hold_base(arm: ArmSpec) -> Task:
    """The base module's end stays; the tip goes once around. mu_p tip 1, mu_p base 4, mu_d 0.5.

    Raises:
        TargetError: an arm of one module.
    """
    _check_modules("hold-base", arm, 2)
    held = np.array([0.0, 0.0, ArmGeometry.of(arm).lengths[0]])
    rest = Goal.of(arm.module_count, change_weight=0.5).with_position(held, weight=BASE_WEIGHT, module=0)
    path = arm.length * out_and_around(TIP_RADIUS, TIP_HEIGHT, arm.control_rate)
    goals = tuple(rest.with_position(position, weight=1.0) for position in path)
    return Task("hold-base", goals, (Score("constraint", module=0), Score("position")))


def hold_middle(arm: ArmSpec) -> Task:
    """The middle module's end stays on the axis while its own axis turns once around. mu_p = mu_o = 1, mu_d 0.5.

    Raises:
        TargetError: an arm of fewer than three modules.
    """
    _check_modules("hold-middle", arm, 3)
    return _hold_and_turn(arm, "hold-middle", module=(arm.module_count - 1) // 2)


def hold_end(arm: ArmSpec) -> Task:
    """The tip stays on the axis while its own axis turns once around. mu_p = mu_o = 1, mu_d 0.5.

    Raises:
        TargetError: an arm of one module.
    """
    _check_modules("hold-end", arm, 2)
    return _hold_and_turn(arm, "hold-end", module=arm.module_count - 1)


def _hold_and_turn(arm: ArmSpec, name: str, module: int) -> Task:
    lowered, tilt_deg = HELD[name]
    height = ArmGeometry.of(arm).lengths[: module + 1].sum()
    share, angle = approach_shares(arm.control_rate), round_angles(arm.control_rate)
    shares = np.concatenate([share, np.ones_like(angle)])
    heights = height * (1 - (1 - lowered) * shares)
    axes = tilted_axes(np.deg2rad(tilt_deg) * shares, np.concatenate([np.zeros_like(share), angle]))
    rest = Goal.of(arm.module_count, change_weight=0.5)
    goals = tuple(
        rest.with_position([0.0, 0.0, z], weight=1.0, module=module).with_axis(axis, weight=1.0, module=module)
        for z, axis in zip(heights, axes, strict=True)
    )
    return Task(name, goals, (Score("constraint", module=module), Score("orientation", module=module)))


def _check_modules(name: str, arm: ArmSpec, least: int) -> None:
    if arm.module_count < least:
        raise TargetError(
            f"the task '{name}' needs an arm of at least {least} modules, '{arm.name}' has {arm.module_count}; "
            "choose another task"
        )
