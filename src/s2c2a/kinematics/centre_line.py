"""The centre line between module ends, from states alone."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.spaces import AXIS, CENTRE_LINE_POINTS, POSITION

_SHARES = np.arange(1, CENTRE_LINE_POINTS + 1, dtype=np.float32)[:, None] / CENTRE_LINE_POINTS


def centre_line(
    states: Float[Array, "*batch modules 6"], lengths: Float[Array, " modules"]
) -> Float[Array, "*batch points 3"]:
    """Points along the arm, five a module from base to tip, the last of each at the module's end [m], base frame.

    Between two ends runs the cubic that has their positions and axes (Hermite), its speed the module's length: within
    a millimetre of an arc of 0.2 m and 50 deg.

    Args:
        states: end position [m] and axis of every module, base frame.
        lengths: of the modules [m].
    """
    base = jnp.broadcast_to(jnp.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), (*states.shape[:-2], 1, 6))
    before = jnp.concatenate([base, states[..., :-1, :]], axis=-2)[..., None, :]
    after = states[..., None, :]
    s, speed = _SHARES, lengths[:, None, None]
    points = (
        (2 * s**3 - 3 * s**2 + 1) * before[..., POSITION]
        + (s**3 - 2 * s**2 + s) * speed * before[..., AXIS]
        + (3 * s**2 - 2 * s**3) * after[..., POSITION]
        + (s**3 - s**2) * speed * after[..., AXIS]
    )  # (*batch, modules, points of a module, 3)
    return jnp.asarray(points).reshape(*states.shape[:-2], -1, 3)
