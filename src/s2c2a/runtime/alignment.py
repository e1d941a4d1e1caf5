"""Time alignment: late measurements of states, moved to the times of the readings."""

import numpy as np
from jaxtyping import Float

from s2c2a.arm.geometry import interpolated
from s2c2a.spaces import AXIS, States

# s between two measurements; two steps of 10 Hz, beyond which motion is a guess
MAX_GAP = 0.2


def align_states(
    times: Float[np.ndarray, " steps"],
    states: States,
    ages: Float[np.ndarray, " steps"],
) -> States:
    """Return the states at the times of the readings.

    A tracker's frame is older than the reading that contains it. Here both are known
    for the whole run, so that the states between frames follow by linear
    interpolation.

    Args:
        times: of the readings [s].
        states: of the newest frame in every reading, shape (steps, modules, 6); NaN
            where a module was not tracked.
        ages: of those frames [s]; NaN without a frame.

    Returns:
        States of the same shape; NaN where the two frames around a reading are more
        than `MAX_GAP` apart, and after the last frame.
    """
    exposures = times - ages
    aligned = np.full_like(states, np.nan)
    for module in range(states.shape[1]):
        values = states[:, module]
        is_known = np.isfinite(exposures) & np.isfinite(values).all(axis=-1)
        if is_known.sum() > 1:
            moments, rows = np.unique(exposures[is_known], return_index=True)
            frames = values[is_known][rows]
            is_between = (times >= moments[0]) & (times <= moments[-1])
            after = np.clip(np.searchsorted(moments, times), 1, len(moments) - 1)
            gaps = moments[after] - moments[after - 1]
            found = interpolated(times, moments, frames)
            found[:, AXIS] /= np.linalg.norm(found[:, AXIS], axis=-1, keepdims=True)
            is_close = is_between & (gaps <= MAX_GAP)
            aligned[is_close, module] = found[is_close]
    return aligned
