"""Text on trainings: errors on held-out samples, and the modal model."""

from collections.abc import Mapping, Sequence

from s2c2a.arm import ArmSpec
from s2c2a.estimation import MODAL_MODEL
from s2c2a.strategies import TrainedNetworks

MIN_REDUCTION = 0.1  # of the error [%]; a reader takes less for none


def describe_held_out_errors(networks: TrainedNetworks) -> list[str]:
    """A line of errors at the tip [mm] for each network, and `describe_controller`."""
    lines = [
        f"{name} at the tip: {1e3 * error:.1f} mm (mean) on {samples}, which have gaps of "
        "time to those of the training"
        for name, result in networks.trained.items()
        for samples, error in result.errors.items()
    ]
    percent = {name: result.percent for name, result in networks.trained.items()}
    warning = describe_controller(networks.arm, percent)
    return [*lines, warning] if warning else lines


def describe_controller(arm: ArmSpec, percent: Mapping[str, Sequence[float]]) -> str:
    """Warn of a C2A that errs by more than a command may change in a control step.

    The arm then moves elsewhere than planned, and no integral correction brings it back.

    Args:
        arm: that it was trained for.
        percent: mean errors of its networks, as in their file.
    """
    smallest_bend = min(module.bend_limit_deg for module in arm.modules)
    # bends go to both sides
    step = 100.0 * arm.step_limit_deg / (2.0 * smallest_bend)
    if "C2A" not in percent or not percent["C2A"][0] > step:
        return ""
    return (
        f"warning: C2A errs by more than a control step ({step:.1f} %): the arm may "
        "move elsewhere than planned. Use --strategy pcc, or train on a longer recording. "
        "In it, the cables of a module should not all pull at the same time: this "
        "stiffens a module and hardly bends it, so that one bend has many commands"
    )


def describe_modal_model(networks: TrainedNetworks) -> str:
    """Describe how much of the vibration the modal model explains.

    Empty without a modal model that was identified in this training.
    """
    if MODAL_MODEL not in networks.trained:
        return ""
    modal_model = networks.trained[MODAL_MODEL]
    percent, _ = modal_model.percent
    nominal = "frequency and damping are those of the arm file"
    # without any complete episode, both errors of the curve are zero
    if not modal_model.curve[:, 1:].any():
        return (
            "modal model: the recording has no complete episode that is long enough, so "
            f"the vibration is unknown; {nominal}"
        )
    # also true for NaN
    if not percent < 100.0 - MIN_REDUCTION:
        return (
            "modal model: frequency and damping fit the recording, but do not reduce the "
            "fast part of the C2S error, so that little of it is vibration"
        )
    return (
        f"modal model: it reduces the fast part of the C2S error by "
        f"{100.0 - percent:.2g} %"
    )
