"""Solving for bends by damped least squares (Levenberg-Marquardt) with a projection after every step.

Few variables (two a module) and a forward model that is dear: all directions of the Jacobian go through the model side
by side, and a handful of steps end nearer to the optimum than dozens of gradient steps.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

Residuals = Callable[[Float[Array, " variables"]], Float[Array, " residuals"]]
Projection = Callable[[Float[Array, " variables"]], Float[Array, " variables"]]

FIRST_DAMPING = 1e-2
DAMPING_RANGE = (1e-6, 1e4)


class _Step(NamedTuple):
    """Where the search stands."""

    point: Float[Array, " variables"]
    residuals: Float[Array, " residuals"]
    jacobian: Float[Array, "residuals variables"]
    damping: Float[Array, ""]


def solve_least_squares(
    residuals: Residuals, start: Float[Array, " variables"], project: Projection, iterations: int
) -> Float[Array, " variables"]:
    """Minimise the sum of squared residuals near a start.

    Each iteration solves (J^T J + lambda I) step = -J^T r, projects, and keeps the step only where the sum falls;
    lambda shrinks after a kept step and grows after a refused one.

    Args:
        residuals: variables -> residuals, differentiable.
        start: where to begin; it is projected first.
        project: onto what is allowed; the identity where everything is.
        iterations: how many.
    """
    directions = jnp.eye(start.shape[0])

    def linearised(point):
        values, slopes = jax.vmap(lambda direction: jax.jvp(residuals, (point,), (direction,)), out_axes=(None, 1))(
            directions
        )
        return values, slopes

    def iterate(_, step: _Step) -> _Step:
        normal = step.jacobian.T @ step.jacobian + step.damping * directions
        change = jnp.linalg.solve(normal, step.jacobian.T @ step.residuals)
        point = project(step.point - change)
        values, slopes = linearised(point)
        better = jnp.sum(values**2) < jnp.sum(step.residuals**2)
        damping = jnp.clip(step.damping * jnp.where(better, 0.2, 10.0), *DAMPING_RANGE)
        tried = _Step(point, values, slopes, damping)
        kept = jax.tree.map(lambda new, old: jnp.where(better, new, old), tried, step)
        return kept._replace(damping=damping)

    first = project(start)
    values, slopes = linearised(first)
    begun = _Step(first, values, slopes, jnp.asarray(FIRST_DAMPING))
    return jax.lax.fori_loop(0, iterations, iterate, begun).point
