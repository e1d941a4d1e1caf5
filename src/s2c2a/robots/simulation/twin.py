"""A body that moves as another description says than the one that controllers are told."""

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.errors import S2C2AError


def twin_of(arm: ArmSpec, file: str) -> ArmSpec:
    """The description in a file, such as `s2c2a identify` writes, at the rate and with the sensors of an arm.

    Raises:
        S2C2AError: it is of another form.
    """
    twin = load_arm(file)
    forms = [(one.actuation, one.module_count, one.cable_count) for one in (arm, twin)]
    if forms[0] != forms[1]:
        said = [
            f"{modules} modules of {cables} cables, driven by {how}"
            for how, modules, cables in forms
        ]
        raise S2C2AError(
            f"{arm.name} has {said[0]}, its twin {file} has {said[1]}; both must be one arm"
        )
    # physics steps divide the control period
    as_driven = {"control_rate": arm.control_rate, "sensors": arm.sensors}
    return twin.model_copy(update=as_driven)
