"""Arms that differ from a preset in one thing the paper tries: coupled sensors, coupled cables."""

from s2c2a.arm import ArmSpec
from s2c2a.errors import ArmError
from s2c2a.sensing import PAPER_COUPLING


def sensing_coupled(arm: ArmSpec) -> ArmSpec:
    """Sensors that pass through the whole arm (Chen et al. 2025, eq. (11)).

    Raises:
        ArmError: not an arm of three modules.
    """
    if arm.module_count != len(PAPER_COUPLING):
        raise ArmError(f"the paper's sensing coupling is for three modules; '{arm.name}' has {arm.module_count}")
    coupled = {"name": f"{arm.name}_sensing_coupled", "sensing_coupling": PAPER_COUPLING}
    return ArmSpec.model_validate(arm.model_dump() | coupled)


def actuation_coupled(arm: ArmSpec) -> ArmSpec:
    """Cables that pass through all modules below their own (Chen et al. 2025, fig. 9C).

    Tensions are halved: those of all modules add up at the base, which would otherwise bend three times as far.
    """
    described = arm.model_dump() | {"name": f"{arm.name}_actuation_coupled", "coupled_cables": True}
    for module in described["modules"]:
        for tension in ("pretension", "tension_range"):
            if module.get(tension):
                module[tension] = module[tension] / 2
    return ArmSpec.model_validate(described)
