"""Five arms at rest with tips from an independent computation, for any simulator."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.arm.spec import ArmSpec, Module

# Turn the base frame into the world frame, in which gravity is -z and the tips were
# printed.
_HANGING = np.array([[1, 0, 0], [0, -1, 0], [0, 0, -1]])  # 180 deg about x
_HORIZONTAL = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # +90 deg about x

_NO_GRAVITY = np.zeros(3)
_DOWN = np.array([0.0, 0.0, -1.0])
_NO_FORCE = np.zeros(3)
_TIP_WEIGHT = np.array([0.0, 0.0, -0.981])


@dataclass(frozen=True, eq=False)
class RodCase:
    """One arm under load and where its tip comes to rest.

    Attributes:
        name: one letter.
        arm: three modules of 0.2 m, the middle one turned by 60 deg.
        tensions: cable tensions [N], shape (modules, cables).
        tip_force: force on the tip [N], base frame, shape (3,).
        tip: tip position [m], base frame, shape (3,), known to 1e-6 m.
    """

    name: str
    arm: ArmSpec
    tensions: Float[np.ndarray, "modules cables"]
    tip_force: Float[np.ndarray, "3"]
    tip: Float[np.ndarray, "3"]


def rod_cases() -> tuple[RodCase, ...]:
    """Cases A to E: no gravity, hanging bend, hanging S, lying arm, with payload."""
    bend = [[9, 1, 1], [9, 1, 9], [9, 1, 1]]
    s_shape = [[9, 1, 1], [1, 1, 8], [1, 9, 1]]
    return (
        _case(
            "A",
            _HANGING,
            _NO_GRAVITY,
            [[6, 0, 0], [6, 0, 6], [6, 0, 0]],
            _NO_FORCE,
            [0.432139, 0, -0.230940],
        ),
        _case("B", _HANGING, _DOWN, bend, _NO_FORCE, [0.281370, 0, -0.458210]),
        _case(
            "C", _HANGING, _DOWN, s_shape, _NO_FORCE, [0.153782, 0.033123, -0.560987]
        ),
        _case(
            "D",
            _HORIZONTAL,
            _DOWN,
            [[1, 1, 1]] * 3,
            _NO_FORCE,
            [0, -0.295656, -0.483758],
        ),
        _case("E", _HANGING, _DOWN, bend, _TIP_WEIGHT, [0.147570, 0, -0.560464]),
    )


def _case(
    name: str,
    mount: np.ndarray,
    gravity: np.ndarray,
    tensions: list,
    force: np.ndarray,
    tip: list,
) -> RodCase:
    """Transform gravity, force and tip from world to base frame; row vectors."""
    arm = _arm(f"rod-case-{name}", tuple(gravity @ mount))
    return RodCase(
        name, arm, np.array(tensions, dtype=float), force @ mount, np.array(tip) @ mount
    )


def _arm(name: str, gravity_direction: tuple[float, float, float]) -> ArmSpec:
    straight = (0.0, 120.0, 240.0)
    turned = (60.0, 180.0, 300.0)
    return ArmSpec(
        name=name,
        actuation="tension",
        sensing="true",
        gravity_direction=gravity_direction,
        modules=(_module(straight), _module(turned), _module(straight)),
    )


def _module(cable_angles_deg: tuple[float, ...]) -> Module:
    return Module(
        length=0.2,
        cable_radius=0.03,
        cable_angles_deg=cable_angles_deg,
        mass=0.08,
        bending_stiffness=0.05,
        pretension=1.0,
        tension_range=10.0,
    )
