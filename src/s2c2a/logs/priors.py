"""First guess of the cable model's parameters, and how far a fit may move them."""

import numpy as np
from jaxtyping import Float

from s2c2a.logs.cable_model import CableParameters
from s2c2a.logs.log_map import LogMap
from s2c2a.logs.registration import Registration

Angles = Float[np.ndarray, " drives"]
# largest deviation from stated values: errors of careful measurements by hand
BASE_BOUND = 0.002  # m, of each coordinate
LENGTH_BOUND = 0.002  # of the logarithm
TILT_BOUND = np.deg2rad(1.0)  # about each of x and y
WRONG_ANGLE = 0.5  # rad; a larger error says nothing of the turn of the frame
# deviations of what a map may state, where it does not [logarithm, rad, m]
UNSTATED_STD = {"lengths": 0.2, "total": 0.2, "tilt": 0.1, "base": 0.1}
STIFFNESS = 0.2  # first guess: stiffness of the arm over that of its cables


def prior_std(log_map: LogMap) -> dict[str, float]:
    """Standard deviation of each parameter about its first guess."""
    arm = log_map.arm
    return {
        "angles": 2.0,
        "gain": 3.0,
        "gains": 0.3 if log_map.drives[0].unit == "free" else 0.1,
        "offsets": 0.1,
        "lengths": UNSTATED_STD["lengths"] if arm.lengths is None else 0.002,
        "total": UNSTATED_STD["total"] if arm.length is None else 0.002,
        "stiffness": 2.0,
        "gravity": 0.3 if any(arm.gravity_direction) else 1e-6,
        # errors of the model repeat, so data alone would tilt the frame by degrees
        "tilt": UNSTATED_STD["tilt"] if log_map.frame.along is None else 0.01,
        "base": UNSTATED_STD["base"] if log_map.frame.base is None else 0.002,
    }


def stated_bounds(
    registration: Registration, log_map: LogMap
) -> dict[str, tuple[np.ndarray, float]]:
    """Stated values of parameters and of `total`, and their largest deviations."""
    arm = log_map.arm
    bounds: dict[str, tuple[np.ndarray, float]] = {}
    if log_map.frame.base is not None:
        bounds["base"] = (registration.base, BASE_BOUND)
    if log_map.frame.along is not None:
        bounds["tilt"] = (np.zeros(2), TILT_BOUND)
    if arm.lengths is not None:
        bounds["lengths"] = (np.log(registration.lengths), LENGTH_BOUND)
    if arm.length is not None:
        bounds["total"] = (np.log(registration.lengths.sum()), LENGTH_BOUND)
    return bounds


def first_guess(registration: Registration, log_map: LogMap) -> CableParameters:
    """First guess; angles and gains are replaced later."""
    zeros = np.zeros(len(log_map.drives))
    return CableParameters(
        angles=zeros,
        gain=np.array(0.0),
        gains=zeros,
        offsets=zeros,
        lengths=np.log(registration.lengths),
        stiffness=np.array(np.log(STIFFNESS)),
        gravity=np.array(0.0),
        tilt=np.zeros(2),
        base=registration.base,
    )


def stated_angles(log_map: LogMap) -> Angles:
    """Stated angles of the drives [rad]; NaN where none is stated."""
    degrees = np.array([drive.angle_deg for drive in log_map.drives], float)
    return np.deg2rad(degrees)


def with_stated_angles(
    angles: Angles,
    stated: Angles,
    log_map: LogMap,
) -> Angles:
    """Angles [rad] where stated ones replace estimated ones, turned if x is unknown."""
    errors = without_turn(angles - stated, log_map)
    return angles - np.nan_to_num(errors)


def without_turn(errors: np.ndarray, log_map: LogMap) -> np.ndarray:
    """Errors of angles [rad]; without the turn of most where x is not stated."""
    turns = errors[np.isfinite(errors)]
    if log_map.frame.x is not None or not len(turns):
        turns = np.zeros(1)
    turned = errors - turns[:, None]
    wrapped = np.angle(np.exp(1j * turned))
    sizes = np.minimum(np.abs(wrapped), WRONG_ANGLE)
    costs = np.nansum(sizes, axis=1)
    return wrapped[np.argmin(costs)]
