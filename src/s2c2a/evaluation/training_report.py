"""Text on trainings: errors on unseen motion, data to record, and the modal model."""

from collections.abc import Mapping

from s2c2a.estimation import MODAL_MODEL
from s2c2a.models import calibration
from s2c2a.strategies import TrainedNetworks

MIN_REDUCTION = 0.1  # of the error [%]; a reader takes less for none
DATA_TO_RECORD = {
    calibration.SLOWER: "slow motion and holds",
    calibration.FASTER: "fast motion",
    calibration.LARGER: "bends near the limits",
    calibration.REGION: "more combinations of bends, opposed ones too",
}
"""Motion to record where errors are large, by the group of samples."""


def describe_unseen_errors(networks: TrainedNetworks) -> list[str]:
    """Describe the errors of each network by the kind of motion, and what to record.

    Args:
        networks: of a training; those without a second training have no line.

    Returns:
        A line of errors at the tip [mm] for each network; where some are much larger
        than on validation samples, a line of advice follows.
    """
    lines = []
    for name, errors in networks.errors.items():
        text = describe_tip_errors(errors)
        lines.append(f"{name} on motion that a second training has not seen: {text}")
        if advice := advise_on_data(errors):
            lines.append(advice)
    return lines


def describe_tip_errors(errors: Mapping[str, float]) -> str:
    """List mean errors of the tip [m] in millimeters, by the group of samples."""
    texts: list[str] = []
    for group, error in errors.items():
        unit = "" if texts else " mm"
        texts.append(f"{group} {1e3 * error:.1f}{unit}")
    return ", ".join(texts)


def advise_on_data(errors: Mapping[str, float]) -> str:
    """Advise which data to record; empty if no error is much above the usual one.

    Args:
        errors: mean errors of the tip [m], by the group of samples.
    """
    usual = errors.get(calibration.INSIDE)
    if usual is None:
        return ""
    large = [group for group in DATA_TO_RECORD if errors.get(group, 0.0) > 2 * usual]
    if not large:
        return ""
    wanted = "; ".join(DATA_TO_RECORD[group] for group in large)
    return (
        f"errors on {' and '.join(large)} are more than twice those on "
        f"{calibration.INSIDE}: record more data with {wanted}"
    )


def describe_modal_model(networks: TrainedNetworks) -> str:
    """Describe how much of the vibration the modal model explains.

    Empty without a modal model that was identified in this training.
    """
    if MODAL_MODEL not in networks.percent:
        return ""
    percent, _ = networks.percent[MODAL_MODEL]
    nominal = "frequency and damping are those of the arm file"
    # without any complete episode, both errors of the curve are zero
    if not networks.curves[MODAL_MODEL][:, 1:].any():
        return (
            "modal model: the recording has no complete episode that is long enough, so "
            f"the vibration is unknown; {nominal}"
        )
    # also true for NaN
    if not percent < 100.0 - MIN_REDUCTION:
        return f"modal model: the recording does not show the vibration; {nominal}"
    return (
        f"modal model: it reduces the fast part of the C2S error by "
        f"{100.0 - percent:.2g} %"
    )
