"""One plan: what its core allows, and the paper's own way beside it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from operations import count_operations
from s2c2a.estimation import Estimate
from s2c2a.execution.compilation import compiled
from s2c2a.planning.guides import Lead
from s2c2a.tasks import circle

from driving import following, module_with, planner_of, straight, times_over

COMPARED = 50  # plans
# PyTorch fills the caches: a single plan right after one of its takes twice
# as long
TOGETHER = 10
SQUARE = 256  # rows of the matrices whose product measures the peak speed of this core


@pytest.mark.asked("at most 1.3 ms")
def test_plan(benchmark, networks):
    """The operations of one pass of its solver, beside the time of the whole plan."""
    planner = planner_of(networks)
    goals = circle(networks.arm).goals
    plan = planner.start(Estimate(straight(networks.arm.module_count)))
    counted = count_operations(
        planner.step.next_plan,
        plan,
        plan.configurations,
        goals[0],
        plan.disturbances,
        plan.memory,
        Lead.none(networks.arm.module_count),
        None,
    )
    benchmark.extra_info["operations [million]"] = counted["arithmetic"] / 1e6
    benchmark(following(planner, goals))


def test_matrix_product(benchmark):
    """What this core can do at best."""
    square = np.random.default_rng(0).normal(size=(SQUARE, SQUARE)).astype(np.float32)
    product = compiled(jnp.matmul)
    benchmark(lambda: jax.block_until_ready(product(square, square)))
    if benchmark.stats:
        speed = 2e-9 * SQUARE**3 / benchmark.stats.stats.median
        benchmark.extra_info["operations [1000 million/s]"] = speed


@pytest.mark.asked("PyTorch takes at least 15 times as long")
def test_ten_plans_beside_eager_pytorch(in_turn, networks_of):
    torch_planner = module_with("torch", "torch_planner")
    networks = networks_of("paper")
    planner = planner_of(networks)
    goals = circle(networks.arm).goals
    assert difference(networks, planner, goals, torch_planner) < 1e-4
    ours = following(planner, goals)
    theirs = torch_planner.following(networks, goals)
    in_turn(
        times_over(ours, TOGETHER), times_over(theirs, TOGETHER), "PyTorch", rounds=100
    )


def difference(networks, planner, goals, torch_planner) -> float:
    """Largest difference of any number between plans from the same start."""
    theirs = torch_planner.planner_of(networks)
    plan = planner.start(Estimate(straight(networks.arm.module_count)))
    worst = 0.0
    for goal in goals[:COMPARED]:
        last = plan.configurations
        plan = planner.plan(plan, Estimate(last), goal)
        planned = theirs.plan(
            torch_planner.tensor(last), torch_planner.TorchGoal.of(goal)
        ).numpy()
        worst = max(
            worst, float(np.abs(planned - np.asarray(plan.configurations)).max())
        )
    return worst
