"""How far wanted positions are out of an arm's reach."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import TargetError
from s2c2a.kinematics import limit_lengths, states_from_bends
from s2c2a.planning.least_squares import solve_least_squares
from s2c2a.spaces import POSITION

ITERATIONS = 30
ON_AXIS = 1e-3  # of the arm's length: a point so near to the axis is on no side of it
REST_WEIGHT = 1e-3  # of bends against positions in units of the arm's length: keeps solutions from wandering


def reach_gaps(
    arm: ArmSpec, positions: Float[np.ndarray, "points 3"], module: int = -1
) -> Float[np.ndarray, " points"]:
    """Distance from wanted positions to the nearest end that the arm can bring a module to [m].

    The arm is taken as constant-curvature arcs within its bend limits, so a true arm differs a little at the edge.

    Args:
        arm: the arm.
        positions: wanted positions [m], base frame.
        module: whose end shall go there.

    Raises:
        TargetError: no such module.
    """
    count = arm.module_count
    if not -count <= module < count:
        raise TargetError(f"no module {module}; '{arm.name}' has {count}, from 0 at the base to {count - 1}, or -1")
    last = range(count)[module] + 1
    geometry = ArmGeometry.of(arm)
    lengths = jnp.asarray(geometry.lengths[:last], dtype=jnp.float32)
    limits = jnp.asarray(geometry.bend_limits[:last], dtype=jnp.float32)
    return np.asarray(_gaps(jnp.asarray(positions, dtype=jnp.float32), lengths, limits))


@jax.jit
def _gaps(positions, lengths, limits):
    size = jnp.sum(lengths)

    def end(bends):
        return states_from_bends(bends.reshape(-1, 2), lengths)[-1, POSITION]

    def project(bends):
        return limit_lengths(bends.reshape(-1, 2), limits).reshape(-1)

    def gap(position, start):
        def residuals(bends):
            return jnp.concatenate([(end(bends) - position) / size, REST_WEIGHT * bends])

        return jnp.linalg.norm(end(solve_least_squares(residuals, start, project, ITERATIONS)) - position)

    def least(position):
        """From shapes towards the point: all modules alike, and the lower half alone.

        On the arm's axis any side will do, but some side is needed: a straight arm would stay straight.
        """
        aside = jnp.linalg.norm(position[:2])
        towards = jnp.where(aside > ON_AXIS * size, position[:2] / jnp.maximum(aside, ON_AXIS * size), jnp.eye(2)[0])
        alike = 0.5 * limits[:, None] * towards
        lower = alike * (jnp.arange(len(limits)) < len(limits) / 2)[:, None] * 2.0
        starts = jnp.stack([alike, lower, 0.1 * alike]).reshape(3, -1)
        return jax.vmap(lambda start: gap(position, start))(starts).min()

    return jax.vmap(least)(positions)
