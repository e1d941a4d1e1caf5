"""Simulated mechanics that differ from the arm description of the controllers."""

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.errors import S2C2AError


def load_twin(arm: ArmSpec, file: str) -> ArmSpec:
    """Load an arm file, with the control rate and the sensors of `arm`.

    `s2c2a identify` writes such files.

    Raises:
        S2C2AError: the two arms differ in modules, cables or actuation.
    """
    twin = load_arm(file)
    layout, twin_layout = (
        f"{each.layout} with {each.actuation} actuation" for each in (arm, twin)
    )
    if layout != twin_layout:
        raise S2C2AError(
            f"{arm.name} has {layout}, its twin {file} has {twin_layout}; "
            "both must be one arm"
        )
    # Physics steps divide the control period.
    update = {"control_rate": arm.control_rate, "sensors": arm.sensors}
    return twin.model_copy(update=update)
