"""One plan: the paper's own way beside it, and the cost of unused obstacle capacity."""

import numpy as np
import pytest

from s2c2a.estimation import Estimate
from s2c2a.tasks import circle

from driving import following, module_with, planner_of, straight, times_over

COMPARED = 50  # plans
# PyTorch fills the caches: a single plan right after one of its takes twice
# as long
TOGETHER = 10


@pytest.mark.asked("at most 1.3 ms")
def test_plan(benchmark, networks):
    benchmark(following(planner_of(networks), circle(networks.arm).goals))


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
