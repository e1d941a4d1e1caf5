"""Pieces that paths are made of. Lengths are of an arm of length one; times in seconds."""

import numpy as np
from jaxtyping import Float

APPROACH_TIME, ROUND_TIME = 4.0, 16.0
PAPER_LENGTH = 0.6  # m: lengths of the protocol are for an arm of this length

Path = Float[np.ndarray, "steps 3"]


def approach_shares(control_rate: float) -> Float[np.ndarray, " steps"]:
    """How much of the way out is done after every step of the approach."""
    steps = round(APPROACH_TIME * control_rate)
    return np.arange(1, steps + 1) / steps


def round_angles(control_rate: float) -> Float[np.ndarray, " steps"]:
    """Angle after every step of once around, anticlockwise seen from above [rad]."""
    steps = round(ROUND_TIME * control_rate)
    return 2 * np.pi * np.arange(1, steps + 1) / steps


def out_and_around(radius: float, height: float, control_rate: float) -> Path:
    """Out along the arc of equal bends, then once around at one height.

    The arc ends near that height; what is missing is spread over the way.
    """
    share = approach_shares(control_rate)
    climb = np.array([arc_height(radius * part) for part in share])
    climb += (height - climb[-1]) * share
    way_out = np.stack([radius * share, np.zeros_like(share), climb], axis=-1)
    angle = round_angles(control_rate)
    around = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full_like(angle, height)], axis=-1)
    return np.concatenate([way_out, around])


def straight(start, end, speed: float, control_rate: float) -> Path:
    """From a point to another at a constant speed, the end included, the start not."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    steps = max(1, round(float(np.linalg.norm(end - start)) / speed * control_rate))
    return start + (end - start) * np.arange(1, steps + 1)[:, None] / steps


def still(point, time: float, control_rate: float) -> Path:
    """Staying at a point."""
    return np.tile(np.asarray(point, dtype=float), (round(time * control_rate), 1))


def tilted_axes(
    tilt: Float[np.ndarray, " steps"], azimuth: Float[np.ndarray, " steps"]
) -> Float[np.ndarray, "steps 3"]:
    """Unit vectors tilted from the vertical towards an azimuth [rad]."""
    return np.stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)], axis=-1)


def arc_height(reach: float) -> float:
    """Height of the end of an arc of length one that reaches so far aside."""
    from scipy.optimize import brentq  # noqa: PLC0415 (a third of a second that few starts need)

    angle = brentq(lambda f: (1 - np.cos(f)) / f - reach, 1e-9, 2.0)
    return float(np.sin(angle) / angle)
