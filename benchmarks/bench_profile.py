"""Parts of a plan: time of each, repeated within one call, and counted operations."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from operations import count_operations
from s2c2a.estimation import Estimate
from s2c2a.execution.compilation import compiled
from s2c2a.planning import Adam
from s2c2a.tasks import circle

from driving import Call, following, planner_of, straight

TURNS = 100  # of a piece within one call, so that the call itself does not count
SQUARE = 256  # rows of the matrices whose product measures the peak speed of this core


@pytest.fixture
def planned(networks):
    """A planner, its first plan, and the goals of the circle."""
    planner = planner_of(networks)
    return (
        planner,
        planner.start(Estimate(straight(networks.arm.module_count))),
        circle(networks.arm).goals,
    )


def test_matrix_product(benchmark):
    """What this core can do at best."""
    square = np.random.default_rng(0).normal(size=(SQUARE, SQUARE)).astype(np.float32)
    benchmark(_calling(compiled(jnp.matmul), square, square))
    if benchmark.stats:
        benchmark.extra_info["Gop/s"] = 2e-9 * SQUARE**3 / benchmark.stats.stats.median


def test_plan(benchmark, planned):
    """Its operations over what the core does at best are the floor of its time."""
    planner, plan, goals = planned
    counted = count_operations(planner.plan, plan, plan.configurations, goals[0])
    benchmark.extra_info |= {
        f"{kind} [million]": count / 1e6 for kind, count in counted.items()
    }
    benchmark(following(planner, goals))


def test_the_call_alone(benchmark, planned):
    _, plan, goals = planned
    benchmark(_calling(compiled(_nothing), plan, plan.configurations, goals[0]))


def test_100_looks_at_the_model(benchmark, networks, planned):
    benchmark(_turning(_look, networks.c2s, planned[1]))


def test_100_looks_with_slopes(benchmark, networks, planned):
    is_adam = isinstance(networks.recipe.planner.solver, Adam)
    look = _look_with_gradient if is_adam else _look_with_slopes
    benchmark(_turning(look, networks.c2s.for_planning(), planned[1]))


def test_100_sets_of_linear_equations(benchmark, arm):
    benchmark(_turning(_solve, jnp.eye(2 * arm.module_count)))


def _calling(program: Callable[..., Any], *inputs: Any) -> Call:
    return lambda: jax.block_until_ready(program(*inputs))


def _turning(piece: Callable[..., Any], *inputs: Any) -> Call:
    """A call that repeats a part, each time on the last result, so that none is skipped."""
    return _calling(compiled(_turned, piece, *inputs))


def _turned(piece: Callable[..., Any], *inputs: Any):
    return jax.lax.fori_loop(
        0, TURNS, lambda _, drift: 1e-6 * piece(drift, *inputs), jnp.zeros(())
    )


def _nothing(plan, sensed, goal):
    return plan


def _look(drift, model, plan):
    return jnp.sum(model.predict(plan.configurations + drift, plan.memory))


def _look_with_slopes(drift, model, plan):
    """The Jacobian as least squares computes it: all directions of bends in one batch."""
    modules = plan.configurations.shape[0]
    directions = (
        jnp.zeros((2 * modules, modules, 3))
        .at[:, :, :2]
        .set(jnp.eye(2 * modules).reshape(-1, modules, 2))
    )

    def along(direction):
        return jax.jvp(
            lambda c: model.predict(c, plan.memory),
            (plan.configurations + drift,),
            (direction,),
        )

    states, slopes = jax.vmap(along, out_axes=(None, 0))(directions)
    return jnp.sum(states) + jnp.sum(slopes)


def _look_with_gradient(drift, model, plan):
    """As Adam looks: forth through the model, and back."""
    return jnp.sum(
        jax.grad(lambda c: jnp.sum(model.predict(c, plan.memory) ** 2))(
            plan.configurations + drift
        )
    )


def _solve(drift, matrix):
    return jnp.sum(jnp.linalg.solve(matrix + drift, matrix[0]))
