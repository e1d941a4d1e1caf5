"""Solving for configurations: Adam with a projection after every iteration."""

from collections.abc import Callable

import jax
import optax
from jaxtyping import Array, Float

from s2c2a.planning.objective import Objective

Projection = Callable[[Float[Array, "modules 3"]], Float[Array, "modules 3"]]


def solve(
    objective: Objective,
    start: Float[Array, "modules 3"],
    project: Projection,
    learning_rate: float = 0.02,
    iterations: int = 10,
) -> Float[Array, "modules 3"]:
    """Minimise an objective from a start (Chen et al. 2025, sec. III-A: Adam, 0.02, 10 iterations).

    Args:
        objective: configurations -> value.
        start: where to begin.
        project: onto what counts as a configuration; the identity leaves them free.
        learning_rate: of Adam.
        iterations: how many.
    """
    optimiser = optax.adam(learning_rate)
    gradient = jax.grad(objective)

    def iterate(_, carry):
        configurations, state = carry
        updates, state = optimiser.update(gradient(configurations), state)
        return project(configurations + updates), state

    return jax.lax.fori_loop(0, iterations, iterate, (start, optimiser.init(start)))[0]
