"""Reachable workspace of an arm whose modules bend as arcs of a circle."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import directions_at
from s2c2a.kinematics import states_from_bends
from s2c2a.live.page import Survey
from s2c2a.live.request import Point
from s2c2a.planning import reach_gaps
from s2c2a.spaces import POSITION, Bends, States

POINTS = 400  # of each module; a look


def workspace(arm: ArmSpec) -> Float[np.ndarray, "modules points 3"]:
    """Ends of the modules [m], base frame, for bends sampled from their discs."""
    random = np.random.default_rng(0)
    directions = random.uniform(0, 2 * np.pi, (POINTS, arm.module_count))
    radii = np.sqrt(random.uniform(0, 1, directions.shape))
    angles = ArmGeometry.of(arm).bend_limits * radii
    states = arcs(arm, bends_of(angles, directions))
    return np.swapaxes(states[..., POSITION], 0, 1)


def bends_of(angles: np.ndarray, directions: np.ndarray) -> Bends:
    """Bend vectors [rad] of bend angles and directions [rad], shape (*batch, 2)."""
    return angles[..., None] * directions_at(directions)


def arcs(arm: ArmSpec, bends: Bends) -> States:
    """States [m] for bends [rad] of shape (*batch, modules, 2), as arcs."""
    lengths = jnp.asarray(ArmGeometry.of(arm).lengths, jnp.float32)
    return np.asarray(_states(jnp.asarray(bends, jnp.float32), lengths), dtype=float)


def survey(arm: ArmSpec) -> Survey:
    """Point cloud of the workspace, and the distance of a point from the reach.

    Compiles the distance function.
    """

    def gap(position: Point) -> float:
        return float(reach_gaps(arm, np.array([position]))[0])

    gap((0.0, 0.0, arm.length))
    return workspace(arm), gap


_states = jax.jit(states_from_bends)
