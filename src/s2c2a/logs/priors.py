"""First guess of the cable model's parameters, and how far a fit may move them."""

import numpy as np

from s2c2a.logs.cable_model import CableParameters
from s2c2a.logs.log_map import LogMap
from s2c2a.logs.registration import Registration

STIFFNESS = 0.2  # first guess: stiffness of the arm over that of its cables


def prior_std(log_map: LogMap) -> dict[str, float]:
    """Standard deviation of each parameter about its first guess."""
    arm = log_map.arm
    return {
        "angles": 2.0,
        "gain": 3.0,
        "gains": 0.3 if log_map.drives[0].unit == "free" else 0.1,
        "offsets": 0.1,
        "lengths": 0.2 if arm.lengths is None else 0.002,
        "total": 0.2 if arm.length is None else 0.002,
        "stiffness": 2.0,
        "gravity": 0.3 if any(arm.gravity_direction) else 1e-6,
        # errors of the model repeat, so data alone would tilt the frame by degrees
        "tilt": 0.1 if log_map.frame.along is None else 0.01,
        "base": 0.1 if log_map.frame.base is None else 0.002,
    }


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
