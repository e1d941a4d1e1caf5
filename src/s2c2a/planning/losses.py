"""The losses of the planner, as pure functions of predicted states (Chen et al. 2025, eqs. (4) to (6)).

Lengths are in units of one length scale, the same for x, y and z, so that spheres stay spheres.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.planning.goal import Numbers


def norm(vectors: Float[Numbers, "*batch axis"]) -> Float[Array, "*batch"]:
    """Euclidean norm with gradient zero at zero."""
    squared = jnp.sum(jnp.asarray(vectors) ** 2, axis=-1)
    zero = squared == 0.0
    return jnp.where(zero, 0.0, jnp.sqrt(jnp.where(zero, 1.0, squared)))


def target_loss(
    predicted: Float[Array, "modules 3"], wanted: Float[Numbers, "modules 3"], weights: Float[Numbers, " modules"]
) -> Float[Array, ""]:
    """Sum over modules of weight times distance: mu_p L_p for positions, mu_o L_o for axes (eq. (4))."""
    return jnp.sum(weights * norm(wanted - predicted))


def obstacle_loss(
    points: Float[Array, "points 3"], centres: Float[Numbers, "obstacles 3"], thresholds: Float[Numbers, " obstacles"]
) -> Float[Array, ""]:
    """L_ob, summed over points and obstacles: 1 / d within the threshold, zero outside (eq. (5))."""
    distances = norm(centres - points[:, None])
    inside = (distances <= thresholds) & (thresholds > 0.0)
    return jnp.sum(jnp.where(inside, 1.0 / jnp.where(inside & (distances > 1e-3), distances, 1e-3), 0.0))


def change_loss(configurations: Float[Array, "modules 3"], last: Float[Array, "modules 3"]) -> Float[Array, ""]:
    """L_d: norm of the change of all modules together (eq. (6))."""
    return norm((configurations - last).reshape(-1))
