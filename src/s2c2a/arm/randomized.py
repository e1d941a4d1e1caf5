"""Arms that nobody modeled: the mismatch of real arms, drawn at a strength."""

from collections.abc import Callable
from typing import Any

import numpy as np

from s2c2a.arm.geometry import ArmGeometry
from s2c2a.arm.spec import ArmSpec, Module
from s2c2a.errors import ArmError

Random = np.random.Generator

# either way
ANGLE_DEG = 5.0
RADIUS = 0.06
MASS = 0.1
STIFFNESS = 0.1
COUPLING = 0.25
RATIO = 0.15
HARDENING = 0.2
RELAXING = (1 / 10, 1 / 7)  # of the stiffness, for either time constant
SHORTER = (0.02, 0.04)  # of the length, at full bend
REST_DEG = (2.0, 4.0)
# m
HOMING = 0.3e-3
BACKLASH = (0.2e-3, 1.0e-3)
# 1, N s/m, 1
FRICTION = 0.1
VISCOUS = 50.0
DRIFT = 0.05
DIGITS = 4
MAX_STRENGTH = 2.0


def randomized_arm(base: ArmSpec, seed: int, strength: float) -> ArmSpec:
    """An arm with mismatch, each drawn independently; what its file says of it otherwise is the base's.

    At strength 1 they are as large as in the numbers above, at others in proportion;
    what the base has of backlash and friction itself gives way to what is drawn in the same
    proportion, so that at strength 0 it is the base.

    Args:
        base: how many modules and cables, and all nominal numbers.
        seed: of everything random.
        strength: from 0 to 2.

    Raises:
        ArmError: impossible seed or strength.
    """
    if seed < 0 or not 0 <= strength <= MAX_STRENGTH:
        raise ArmError(
            f"seed {seed} and strength {strength} asked for; take a seed from 0 and 0 to {MAX_STRENGTH:g}"
        )
    name = {"name": f"{base.name[:48]}_{round(100 * strength)}_{seed}"}
    if strength == 0:
        return base.model_copy(update=name)
    random = np.random.default_rng([seed, 7])
    described = base.model_dump()
    # of all cables through a module, its own and outer ones
    pulls = np.cumsum(_pulls_at_full_bend(base)[::-1])[::-1]
    for module, table, pull in zip(
        base.modules, described["modules"], pulls, strict=True
    ):
        table["mismatch"] = _mismatch(module, random, strength, pull)
        table["cable"] |= _losses(module, random, strength, base.actuation)
    if base.actuation == "displacement":
        described["motor"]["homing_error"] = _said(strength * HOMING)
    about = f"{base.name} with the mismatch of a real arm, drawn with seed {seed} at strength {strength:g}."
    return ArmSpec.model_validate(described | name | {"description": about})


def _mismatch(
    module: Module, random: Random, strength: float, pull: float
) -> dict[str, Any]:
    """Of one module, through which cables together pull so much with all modules at full bend [N]."""
    cables = len(module.cable_angles_deg)
    either = _either(random, strength)
    within = _within(random, strength)
    table = {
        "angle_errors_deg": either(ANGLE_DEG, cables),
        "radius_errors": either(RADIUS, cables),
        "coupling": strength * COUPLING,
        "mass_error": either(MASS),
        "stiffness_error": either(STIFFNESS),
        "stiffness_ratio": 1.0 + strength * RATIO,
        "stiff_direction_deg": random.uniform(0.0, 180.0),
        "hardening": strength * HARDENING,
        "relaxing": [within(*RELAXING), within(*RELAXING)],
        "axial_stiffness": pull / within(*SHORTER),
        "rest_bend_deg": within(*REST_DEG),
        "rest_azimuth_deg": random.uniform(0.0, 360.0),
        "drift": strength * DRIFT * random.choice((-1.0, 1.0)),
    }
    return {key: _said(value) for key, value in table.items()}


def _losses(
    module: Module, random: Random, strength: float, actuation: str
) -> dict[str, Any]:
    """Of its cables; a tension arm has no backlash."""
    kept = max(0.0, 1.0 - strength)
    cable = module.cable
    count = len(module.cable_angles_deg)
    drawn = random.uniform(*BACKLASH, count)
    losses: dict[str, Any] = {
        "friction": kept * cable.friction + strength * FRICTION,
        "viscous_friction": kept * cable.viscous_friction + strength * VISCOUS,
    }
    if actuation == "displacement":
        losses["backlash"] = kept * np.array(cable.backlashes(count)) + strength * drawn
    return {key: _said(value) for key, value in losses.items()}


def _either(random: Random, strength: float) -> Callable[..., Any]:
    return lambda most, count=None: strength * random.uniform(-most, most, count)


def _within(random: Random, strength: float) -> Callable[[float, float], float]:
    return lambda low, high: strength * random.uniform(low, high)


def _pulls_at_full_bend(arm: ArmSpec) -> np.ndarray:
    """What the cables of each module pull together when they bend it fully, on average over directions [N]."""
    geometry = ArmGeometry.of(arm)
    if arm.actuation == "displacement":  # one cable alone: T r = EI bend / length
        moments = (
            np.array([module.bending_stiffness for module in arm.modules])
            * geometry.bend_limits
        )
        return (
            moments / geometry.lengths / geometry.cable_radii
            + geometry.pretensions.sum(axis=-1)
        )
    around = np.linspace(0.0, 2 * np.pi, 36, endpoint=False)
    shares = np.stack([np.cos(around), np.sin(around)], axis=-1)[:, None, :]
    actions = geometry.actions_at(np.broadcast_to(shares, (36, arm.module_count, 2)))
    return np.maximum(actions, 0.0).sum(axis=-1).mean(axis=0)


def _said(value: Any) -> Any:
    """As it stands in a file: a number, or a list of them, to so many digits."""
    return np.vectorize(lambda number: float(f"{number:.{DIGITS}g}"))(value).tolist()
