"""Metrics as functions of arrays: one number for every control step (docs/protocol.md)."""

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.spaces import AXIS, POSITION

States = Float[np.ndarray, "steps modules 6"]
Wanted = Float[np.ndarray, "steps modules 3"]
PerStep = Float[np.ndarray, " steps"]


def position_errors(states: States, wanted: Wanted, module: int = -1) -> PerStep:
    """`position` [cm]: distance of a module's end to its target; NaN where there is none."""
    return 100.0 * np.linalg.norm(states[:, module, POSITION] - wanted[:, module], axis=-1)


def tilts_deg(axes: Float[np.ndarray, "steps 3"]) -> PerStep:
    """Angle of axes to the vertical [deg]."""
    return np.rad2deg(np.arctan2(np.linalg.norm(axes[:, :2], axis=-1), axes[:, 2]))


def tilt_errors_deg(states: States, wanted: Wanted, module: int = -1) -> PerStep:
    """`tilt` [deg]: error of the end axis' angle to the vertical; the paper's 'orientation error (z)'."""
    return np.abs(tilts_deg(states[:, module, AXIS]) - tilts_deg(wanted[:, module]))


def azimuth_errors_deg(states: States, wanted: Wanted, module: int = -1) -> PerStep:
    """`azimuth` [deg]: error of the end axis' direction in the x-y plane; the paper's 'orientation error (x)'."""
    true, asked = states[:, module, AXIS], wanted[:, module]
    turned = np.arctan2(true[:, 1], true[:, 0]) - np.arctan2(asked[:, 1], asked[:, 0])
    return np.abs(np.rad2deg((turned + np.pi) % (2 * np.pi) - np.pi))


def orientation_errors_deg(states: States, wanted: Wanted, module: int = -1) -> PerStep:
    """`orientation` [deg]: angle between wanted and true end axis."""
    return angles_deg(states[:, module, AXIS], wanted[:, module])


def angles_deg(first: Float[np.ndarray, "*batch 3"], second: Float[np.ndarray, "*batch 3"]) -> np.ndarray:
    """Angle between vectors, such as configurations, of any length [deg]."""
    cosine = np.sum(first * second, axis=-1)
    sine = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.rad2deg(np.arctan2(sine, cosine))


def clearances(
    points: Float[np.ndarray, "steps *points 3"], obstacles: Float[np.ndarray, "steps obstacles 4"]
) -> PerStep:
    """`clearance` [cm]: smallest distance of any point of a step to an obstacle's centre, less its threshold r.

    Args:
        points: where the arm was in each step [m].
        obstacles: centres and thresholds [m]; one whose threshold is zero is not there, and none leave infinite room.
    """
    flat = points.reshape(len(points), -1, 1, 3)
    centres, thresholds = obstacles[:, None, :, :3], obstacles[:, None, :, 3]
    distances = np.where(thresholds > 0, np.linalg.norm(flat - centres, axis=-1) - thresholds, np.inf)
    return 100.0 * distances.min(axis=(1, 2), initial=np.inf)


def step_lengths(tips: Float[np.ndarray, "steps 3"]) -> PerStep:
    """Way of the tip [cm] in every control step but the first, which counts zero."""
    return 100.0 * np.concatenate([[0.0], np.linalg.norm(np.diff(tips, axis=0), axis=-1)])


def stray(tips: Float[np.ndarray, "steps 3"], obstacles: Float[np.ndarray, "steps obstacles 4"], far: float) -> PerStep:
    """`stillness` [cm]: how far the tip is from where it was when every obstacle last came to be far; NaN while near.

    Args:
        tips: tip positions [m].
        obstacles: centres and thresholds [m].
        far: how much more than its threshold an obstacle is away when it is far [m].
    """
    away = clearances(tips[:, None], obstacles) > 100.0 * far
    begins = np.where(away & ~np.concatenate([[False], away[:-1]]), np.arange(len(tips)), 0)
    since = np.maximum.accumulate(begins)
    return np.where(away, 100.0 * np.linalg.norm(tips - tips[since], axis=-1), np.nan)


def recovery_time(errors: PerStep, inside: Bool[np.ndarray, " steps"], near: float, period: float) -> float:
    """`recovery` [s]: time from the target's last re-entry until the error stays below `near` [cm] to the end.

    NaN where the target never left, infinite where the error does not stay below.
    """
    entries = np.flatnonzero(inside[1:] & ~inside[:-1]) + 1
    if not len(entries):
        return float("nan")
    apart = np.flatnonzero(errors[entries[-1] :] > near)
    if len(apart) and apart[-1] == len(errors) - entries[-1] - 1:
        return float("inf")
    return period * (apart[-1] + 1 if len(apart) else 0)
