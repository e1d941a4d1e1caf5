"""Metrics: one number for every control step."""

import numpy as np
from jaxtyping import Float

from s2c2a.spaces import POSITION


def position_errors(
    states: Float[np.ndarray, "steps modules 6"], wanted: Float[np.ndarray, "steps modules 3"], module: int = -1
) -> Float[np.ndarray, " steps"]:
    """`position` [cm]: distance of a module's end to its target; NaN where there is none."""
    return 100.0 * np.linalg.norm(states[:, module, POSITION] - wanted[:, module], axis=-1)


def configuration_errors_deg(
    true: Float[np.ndarray, "steps modules 3"], wanted: Float[np.ndarray, "steps modules 3"]
) -> Float[np.ndarray, "steps modules"]:
    """Angle between two configurations of each module [deg]; neither needs unit length."""
    cosine = np.sum(true * wanted, axis=-1)
    sine = np.linalg.norm(np.cross(true, wanted), axis=-1)
    return np.rad2deg(np.arctan2(sine, cosine))
