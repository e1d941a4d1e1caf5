"""Jumps of the frame: a camera or the base that was knocked.

All ends then shift at once by one vector and turn no more than a knock turns them. An arm
that moves by itself does otherwise: its outer ends move further than the inner ones, and
an end that is carried aside by a bend turns with it. Smooth motion is taken out, as the mean
velocity before and after. A knock during fast motion stays unseen.
"""

import numpy as np
from jaxtyping import Float

from s2c2a.spaces import AXIS, POSITION

Times = Float[np.ndarray, " rows"]
Shift = Float[np.ndarray, "3"]
LEAST = 0.005
"""Smallest jump, as a share of the arm's length."""
UNEQUAL = 0.25
"""Largest difference of an end's shift from the mean one, as a share of that.
In 7200 steps of fast simulated motion of three arms, none is below it that is larger than
`LEAST`; at 0.35, up to 2 of 1200 are."""
UNUSUAL = 3.0
"""Ratio of a jump to the largest common shift before: the base body's noise is one."""

USUAL = 30  # steps before that are compared: 1 to 3 s of a tracker
_FEWEST = 8  # of them; the largest of fewer is no measure of the noise
AROUND = 3  # rows on either side of a jump


def find_frame_jumps(
    states: Float[np.ndarray, "rows modules 6"], times: Times, length: float
) -> dict[int, Shift]:
    """Find jumps of all ends at once: the shift [m] by the first row after it.

    Two tracked ends are needed, and three rows on either side.

    Args:
        states: end position [m] and end axis, base frame; NaN where not measured.
        times: of the rows [s].
        length: of the arm [m].
    """
    if len(states) < 2 * AROUND:
        return {}
    durations = np.maximum(np.diff(times), np.finfo(float).eps)[:, None, None]
    steps = np.diff(states, axis=0)
    velocities = steps / durations
    # without the mean velocity before and after
    usual = durations[1:-1] * (velocities[:-2] + velocities[2:]) / 2
    sudden = steps[1:-1] - usual
    known = np.all(np.isfinite(sudden), axis=-1)
    sudden = np.where(known[..., None], sudden, 0.0)
    shifts = sudden[..., POSITION]
    common = shifts.sum(axis=1) / np.maximum(known.sum(axis=1), 1)[:, None]
    size = np.linalg.norm(common, axis=-1)
    unequal = np.linalg.norm(shifts - common[:, None], axis=-1)
    turn = np.linalg.norm(sudden[..., AXIS], axis=-1)
    # a bend of one module turns the end by twice its shift over the module's length
    most = size * states.shape[1] / length
    is_common = (known.sum(axis=1) >= 2) & (turn.max(axis=1) < most)
    is_common &= np.where(known, unequal, 0.0).max(axis=1) < UNEQUAL * size
    noise = np.where(is_common, size, 0.0)
    is_jump = is_common & (size > LEAST * length)
    # faster than the steps before and after: next to a jump is half of it
    rates = np.pad(size / durations[1:-1, 0, 0], 1, constant_values=np.inf)
    is_peak = (rates[1:-1] > rates[:-2]) & (rates[1:-1] > rates[2:])
    return {
        int(step) + 2: common[step]
        for step in np.flatnonzero(is_jump & is_peak)
        if _is_unusual(noise, int(step))
    }


def _is_unusual(noise: Float[np.ndarray, " steps"], step: int) -> bool:
    earlier = noise[max(step - 1 - USUAL, 0) : max(step - 1, 0)]
    return len(earlier) >= _FEWEST and bool(noise[step] > UNUSUAL * earlier.max())


def describe_frame_jump(shift: Shift) -> str:
    """Describe a jump, and what to do."""
    values = ", ".join(f"{1e3 * value:.1f}" for value in shift)
    return (
        f"all tracked ends jump by {1e3 * np.linalg.norm(shift):.1f} mm at once, "
        f"({values}) mm in the base frame: a camera or the base was moved, and states "
        "before and after it do not fit each other; calibrate the tracking again, and "
        "record anew (docs/guides/tracking.md)"
    )
