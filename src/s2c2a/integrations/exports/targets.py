"""Targets of an episode for learning."""

import numpy as np
from jaxtyping import Float


def held(targets: Float[np.ndarray, "steps numbers"]) -> np.ndarray:
    """Targets held where there is none, since a network learns nothing from NaN.

    Before the first target, it is that one. A column without any target stays NaN.
    """
    filled = targets.copy()
    for column in filled.T:
        known = np.flatnonzero(np.isfinite(column))
        if len(known):
            last = np.searchsorted(known, np.arange(len(column)), side="right") - 1
            column[:] = column[known[np.maximum(last, 0)]]
    return filled
