"""The centre line between module ends, from states alone: one for NumPy arrays and JAX arrays."""

from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.spaces import AXIS, CENTRE_LINE_POINTS, POSITION


def hermite_weights(shares: Float[np.ndarray, " points"]) -> Float[np.ndarray, "4 points"]:
    """What start, slope there, end and slope there weigh in the cubic (Hermite) at shares 0 to 1 of its way."""
    s = shares
    return np.stack([2 * s**3 - 3 * s**2 + 1, s**3 - 2 * s**2 + s, 3 * s**2 - 2 * s**3, s**3 - s**2])


def centre_line(
    states: Float[Any, "*batch modules 6"], lengths: Float[Any, " modules"], points: int = CENTRE_LINE_POINTS
) -> Float[Any, "*batch points 3"]:
    """Points along the arm from base to tip, the last of each module at its end [m], base frame.

    Between two ends runs the cubic that has their positions and axes (Hermite), its speed the module's length: within
    a millimetre of an arc of 0.2 m and 50 deg, and exact for a straight module.

    Args:
        states: end position [m] and axis of every module, base frame; of NumPy, or of JAX and then differentiable.
        lengths: of the modules [m], of the same kind.
        points: of each module.
    """
    xp, unit = states.__array_namespace__(), np.array([0, 0, 0, 0, 0, 1], states.dtype)
    base = xp.broadcast_to(xp.asarray(unit), (*states.shape[:-2], 1, 6))
    before = xp.concat([base, states[..., :-1, :]], axis=-2)[..., None, :]
    after, speed = states[..., None, :], lengths[:, None, None]
    shares = np.arange(1, points + 1, dtype=states.dtype) / points
    start, slope, end, end_slope = hermite_weights(shares)[..., None]
    line = (
        start * before[..., POSITION]
        + slope * speed * before[..., AXIS]
        + end * after[..., POSITION]
        + end_slope * speed * after[..., AXIS]
    )  # (*batch, modules, points of a module, 3)
    return line.reshape(*states.shape[:-2], -1, 3)
