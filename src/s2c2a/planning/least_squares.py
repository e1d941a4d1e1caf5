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
AFTER_A_KEPT_STEP, AFTER_A_REFUSED_STEP = 0.2, 10.0
DAMPING_RANGE = (1e-6, 1e4)


class _Step(NamedTuple):
    """Where the search stands: a point, the sum of squares there, and the normal equations."""

    point: Float[Array, " variables"]
    cost: Float[Array, ""]
    gradient: Float[Array, " variables"]
    curvature: Float[Array, "variables variables"]
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
        return jax.vmap(lambda direction: jax.jvp(residuals, (point,), (direction,)), out_axes=(None, 1))(directions)

    def iterate(_, step: _Step) -> _Step:
        change = jnp.linalg.solve(step.curvature + step.damping * directions, step.gradient)
        point = project(step.point - change)
        values, slopes = linearised(point)
        cost = jnp.sum(values**2)
        better = cost < step.cost
        damping = jnp.clip(step.damping * jnp.where(better, AFTER_A_KEPT_STEP, AFTER_A_REFUSED_STEP), *DAMPING_RANGE)
        tried = _Step(point, cost, slopes.T @ values, slopes.T @ slopes, damping)
        kept = jax.tree.map(lambda new, old: jnp.where(better, new, old), tried, step)
        return kept._replace(damping=damping)

    # The first turn goes nowhere and looks at the start, so that the model stands once in the program, not twice.
    nothing = jnp.zeros_like(start)
    begun = _Step(
        start, jnp.asarray(jnp.inf), nothing, jnp.zeros_like(directions), jnp.asarray(FIRST_DAMPING / AFTER_A_KEPT_STEP)
    )
    return jax.lax.fori_loop(0, iterations + 1, iterate, begun).point
