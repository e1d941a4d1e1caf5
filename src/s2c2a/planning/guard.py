"""Which points of the arm keep out of obstacles."""

from collections.abc import Callable

import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.kinematics import centre_line
from s2c2a.planning.options import Guard
from s2c2a.spaces import POSITION

GuardedPoints = Callable[[Float[Array, "modules 6"]], Float[Array, "points 3"]]


def guarded_points(arm: ArmSpec, guard: Guard) -> GuardedPoints:
    """States -> positions [m]: the tip alone (Chen et al. 2025, eq. (5)), or the whole arm's centre line."""
    if guard == "tip":
        return lambda states: states[-1:, POSITION]
    lengths = jnp.asarray(ArmGeometry.of(arm).lengths, dtype=jnp.float32)
    return lambda states: centre_line(states, lengths)
