"""Domain randomization: arms with sampled model mismatch of a given strength."""

from typing import Any

import numpy as np

from s2c2a.arm.geometry import ArmGeometry, directions_at, per_module, per_unit_of_pull
from s2c2a.arm.spec import ArmSpec, Mismatch, Module
from s2c2a.errors import ArmError

Random = np.random.Generator

MAX_STRENGTH = 2.0  # times the mismatch of a carefully built arm


def randomized_arm(base: ArmSpec, seed: int, strength: float) -> ArmSpec:
    """Sample an arm with independent model mismatch in every module.

    The numbers below are those of strength 1, a carefully built arm; other strengths are
    in proportion. The base's own backlash and friction fade in the same proportion, so
    strength 0 is the base.

    Args:
        base: modules, cables and all nominal values.
        seed: of all samples.
        strength: from 0 to 2.

    Raises:
        ArmError: the seed or the strength is out of range.
    """
    if seed < 0 or not 0 <= strength <= MAX_STRENGTH:
        raise ArmError(
            f"seed {seed} and strength {strength} are not allowed; "
            f"give a seed of 0 or more and a strength from 0 to {MAX_STRENGTH:g}"
        )
    name = {"name": f"{base.name[:48]}_{round(100 * strength)}_{seed}"}
    if strength == 0:
        return base.model_copy(update=name)
    random = np.random.default_rng([seed, 7])
    described = base.model_dump()

    def either(limit: float, count: int | None = None) -> Any:
        """Sample errors of both signs."""
        return strength * random.uniform(-limit, limit, count)

    def within(low: float, high: float) -> float:
        """Sample a positive value."""
        return strength * random.uniform(low, high)

    # tension of all cables through a module: its own and those of distal modules
    tensions = np.cumsum(_tensions_at_full_bend(base)[::-1])[::-1]
    for module, table, tension in zip(
        base.modules, described["modules"], tensions, strict=True
    ):
        cables = len(module.cable_angles_deg)
        mismatch = {
            "angle_errors_deg": either(5.0, cables),
            "radius_errors": either(0.06, cables),
            "coupling": strength * 0.25,
            "mass_error": either(0.1),
            "stiffness_error": either(0.1),
            "stiffness_ratio": 1.0 + strength * 0.15,
            "stiff_direction_deg": random.uniform(0.0, 180.0),
            "hardening": strength * 0.2,
            "relaxing": [within(1 / 10, 1 / 7), within(1 / 10, 1 / 7)],
            # of the length, with all modules at full bend
            "axial_stiffness": tension / within(0.02, 0.04),
            "rest_bend_deg": within(2.0, 4.0),
            "rest_azimuth_deg": random.uniform(0.0, 360.0),
            "drift": strength * 0.05 * random.choice((-1.0, 1.0)),
        }
        table["mismatch"] = _rounded(mismatch)
        table["cable"] |= _losses(module, random, strength, base.actuation)
        if base.actuation == "pressure":  # chambers do not pass other modules
            table["mismatch"]["coupling"] = None
        if not tension:  # nothing shortens a passive tip
            table["mismatch"]["axial_stiffness"] = None
    if base.actuation == "displacement":
        described["motor"]["homing_error"] = _round(strength * 0.3e-3)  # m
    summary = (
        f"{base.name} with sampled model mismatch, seed {seed}, strength {strength:g}."
    )
    return ArmSpec.model_validate(described | name | {"description": summary})


def without_mismatch(arm: ArmSpec) -> ArmSpec:
    """The arm as its controllers know it: without what `randomized_arm` samples."""
    nominal: dict[str, Any] = {"mismatch": Mismatch()}
    no_losses = {"friction": 0.0, "viscous_friction": 0.0, "backlash": 0.0}
    modules = []
    for module in arm.modules:
        cable = module.cable.model_copy(update=no_losses)
        modules.append(module.model_copy(update=nominal | {"cable": cable}))
    motor = arm.motor.model_copy(update={"homing_error": 0.0})
    return arm.model_copy(update={"modules": tuple(modules), "motor": motor})


def _losses(
    module: Module, random: Random, strength: float, actuation: str
) -> dict[str, Any]:
    """Sample the cable losses of a module; only displacement arms have backlash."""
    if actuation == "pressure":
        return {}
    base_share = max(0.0, 1.0 - strength)
    cable = module.cable
    count = len(module.cable_angles_deg)
    backlash = random.uniform(0.2e-3, 1.0e-3, count)  # m
    losses: dict[str, Any] = {
        "friction": base_share * cable.friction + strength * 0.1,
        "viscous_friction": base_share * cable.viscous_friction + strength * 50.0,
    }
    if actuation == "displacement":
        losses["backlash"] = (
            base_share * np.asarray(cable.backlash) + strength * backlash
        )
    return _rounded(losses)


def _tensions_at_full_bend(arm: ArmSpec) -> np.ndarray:
    """Return the total cable tension of each module at its full bend [N].

    For tension arms this is the mean over bend directions.
    """
    geometry = ArmGeometry.of(arm)
    if arm.actuation == "displacement":  # one cable alone: T r = EI bend / length
        moments = per_module(arm, "bending_stiffness") * geometry.bend_limits
        tensions = moments / geometry.lengths / geometry.cable_radii
        return tensions + geometry.pretensions.sum(axis=-1)
    azimuths = np.linspace(0.0, 2 * np.pi, 36, endpoint=False)
    shares = directions_at(azimuths)[:, None, :]
    actions = geometry.actions_at(np.broadcast_to(shares, (36, arm.module_count, 2)))
    forces = np.maximum(actions, 0.0).sum(axis=-1).mean(axis=0)
    return forces * np.abs(per_unit_of_pull(arm))


def _rounded(table: dict[str, Any]) -> dict[str, Any]:
    """The table in four digits, without lists of the cables of a passive module."""
    return {key: _round(value) for key, value in table.items() if np.size(value)}


def _round(value: Any) -> Any:
    """Round a number, or an array to a list, to four digits, as arm files have them."""
    return np.vectorize(lambda number: float(f"{number:.4g}"))(value).tolist()
