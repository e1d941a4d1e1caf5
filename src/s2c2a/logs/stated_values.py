"""What a fit says of its own numbers: contradicted, unusual, or not determined."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from s2c2a.logs.cable_model import CableParameters
from s2c2a.logs.cable_search import AMBIGUOUS_RATIO
from s2c2a.logs.log_map import ROTATING_UNITS, LogMap
from s2c2a.logs.map_changes import AXES, angles_of
from s2c2a.logs.model_fit import CableFit, Observations, fit_parameters
from s2c2a.logs.priors import UNSTATED_STD, prior_std, with_stated_angles
from s2c2a.logs.take import Drives

KEPT_ANGLE = 0.1  # rad; prior deviation of angles that are kept, half of TOLERANCE_DEG
AT_BOUND = 0.95  # share of the largest deviation; a fit ends just inside
UNSEEN = 0.5  # posterior over prior deviation; a quarter of the number is then a guess
STILL = 0.1  # motion of a drive over the largest one; noise of pressures reaches 0.05
UNUSUAL = 3.0  # prior deviations from the first guess; 3 in 1000 numbers by chance


def describe_contradictions(fit: CableFit, observations: Observations) -> str:
    """Sentence that names the stated values that a fit contradicts; may be empty.

    It ends at their bounds, and explains the log clearly better without them: errors of
    the model reach the bounds, too.

    Args:
        fit: of the observations, with stated values.
        observations: bounds of stated values, and the axes of the frame.
    """
    clauses = []
    for name, (stated, deviation) in observations.bounds.items():
        shares = _share(name, fit.parameters, stated, deviation)
        found = list(_clauses(name, shares, observations.axes))
        if found and _is_better_without(name, fit, observations):
            clauses += found
    if not clauses:
        return ""
    return (
        f"the log contradicts stated values: it fits better with {', '.join(clauses)}; "
        "they are kept: measure them again, or leave them out of the map (an error "
        "of one can show at another)"
    )


def _is_better_without(name: str, fit: CableFit, observations: Observations) -> bool:
    rows = observations.thinned()
    others = {key: value for key, value in rows.bounds.items() if key != name}
    priors = {**rows.prior_std, name: UNSTATED_STD[name]}
    free = replace(rows, bounds=others, prior_std=priors)
    freed = fit_parameters(free, fit.parameters, fit.wiring)
    return freed.cost < AMBIGUOUS_RATIO * fit.cost


def keeps_angles(fit: CableFit, observations: Observations, log_map: LogMap) -> bool:
    """Whether stated angles explain a log as well as free ones.

    Stiffness makes up for the angles of opposed cables.
    """
    angles = with_stated_angles(fit.parameters.angles, angles_of(log_map), log_map)
    priors = {**observations.prior_std, "angles": KEPT_ANGLE}
    rows = replace(observations.thinned(), prior_std=priors)
    kept = fit_parameters(rows, fit.parameters._replace(angles=angles), fit.wiring)
    return AMBIGUOUS_RATIO * kept.cost < fit.cost


def still_drives(columns: Drives, log_map: LogMap) -> list[str]:
    """Names of the drives that hardly move."""
    sizes = np.nanstd(columns, axis=0)
    return [
        f"'{drive.name}'"
        for drive, size in zip(log_map.drives, sizes, strict=True)
        if size < STILL * sizes.max()
    ]


def undetermined_numbers(fit: CableFit, columns: Drives, log_map: LogMap) -> list[str]:
    """What neither the log nor the map determines: angles of drives, lengths, frame."""
    priors = prior_std(log_map)
    assert fit.std is not None
    is_unseen = {
        name: np.atleast_1d(std > UNSEEN * priors.get(name, np.inf))
        for name, std in fit.std._asdict().items()
    }
    still = still_drives(columns, log_map)
    drives = [
        f"'{drive.name}'"
        for drive, unseen in zip(log_map.drives, is_unseen["angles"], strict=True)
        if drive.angle_deg is None and (unseen or f"'{drive.name}'" in still)
    ]
    found = []
    if drives:
        found.append(
            f"angle and gain of {', '.join(drives)} (they hardly move, or the ends do "
            "not follow)"
        )
    arm = log_map.arm
    if is_unseen["lengths"].any() and not arm.length and not arm.lengths:
        found.append("the modules' lengths (arm.lengths)")
    if is_unseen["base"].any() and not log_map.frame.base:
        found.append("frame.base")
    # of a tip alone, offsets resemble a tilt: by itself, it is no fault of the log
    if found and is_unseen["tilt"].any() and not log_map.frame.along:
        found.append("frame.along")
    return found


def unusual_numbers(
    fit: CableFit, start: CableParameters, log_map: LogMap
) -> list[str]:
    """Numbers that are far from the first guess, or from the stated radius."""
    parameters = fit.parameters
    priors = prior_std(log_map)
    texts = {
        "gains": "the gain of a drive is off by a factor of {1:.1f} from the others",
        "offsets": "drives are off their rests by up to {:.1f} rad",
        "lengths": "the length of a module is off by a factor of {1:.1f} from its ends",
        "tilt": "the arm is tilted by {:.2f} rad from the direction that the ends show",
        "base": "the base is {:.2f} m from where the ends show it",
    }
    found = []
    for name, text in texts.items():
        errors = np.abs(getattr(parameters, name) - getattr(start, name))
        if errors.max() > UNUSUAL * priors[name]:
            found.append(text.format(errors.max(), np.exp(errors.max())))
    radius = log_map.arm.cable_radius
    if radius and log_map.drives[0].unit != "free" and not log_map.by_force:
        identified = 1 / np.exp(parameters.gain + np.mean(parameters.gains))
        if abs(np.log(identified / radius)) > UNUSUAL * priors["gains"]:
            found.append(
                f"the bends are those of cables at {1e3 * identified:.1f} mm, not at "
                f"the stated {1e3 * radius:.1f} mm: arm.cable_radius, or "
                f"{_scale_of(log_map)}, is wrong by a factor of "
                f"{max(identified / radius, radius / identified):.1f}"
            )
    return found


def _scale_of(log_map: LogMap) -> str:
    """Keys from which lengths of cables follow."""
    drive = log_map.drives[0]
    keys = "unit or scale of the drives"
    if drive.unit in ROTATING_UNITS:
        return f"arm.pulley_radius, {keys}"
    return keys


def _share(
    name: str, parameters: CableParameters, stated: np.ndarray, deviation: float
) -> np.ndarray:
    """Deviations from stated values over the largest ones."""
    if name == "total":
        value = np.log(np.sum(np.exp(parameters.lengths)))
    else:
        value = getattr(parameters, name)
    return np.atleast_1d((value - stated) / deviation)


def _clauses(
    name: str, shares: np.ndarray, axes: Float[np.ndarray, "3 3"]
) -> Iterator[str]:
    at_bound = np.where(np.abs(shares) >= AT_BOUND, np.sign(shares), 0.0)
    if not at_bound.any():
        return
    if name == "tilt":
        yield f"frame.along turned towards {_direction(at_bound, axes)}"
        return
    for place, sign in enumerate(at_bound):
        if not sign:
            continue
        size = "larger" if sign > 0 else "smaller"
        texts = {
            "base": f"a {size} {'xyz'[place]} of frame.base",
            "lengths": f"a {size} number {place} of arm.lengths",
            "total": f"a {size} arm.length",
        }
        yield texts[name]


def _direction(tilt: Float[np.ndarray, "2"], axes: Float[np.ndarray, "3 3"]) -> str:
    """Axis of the log towards which rotations about x and y turn z."""
    direction = np.array([tilt[1], -tilt[0]])
    towards = axes[:, :2] @ direction
    return AXES[int(np.argmax([*towards, *-towards]))]
