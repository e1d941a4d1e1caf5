"""Batched plans of 1 to 4096 arms at rest; `--device gpu` uses a GPU."""

import jax
import numpy as np
import pytest

from s2c2a.planning import Goal
from s2c2a.strategies import s2c2a_strategy
from s2c2a.tasks import circle
from s2c2a.tasks.lines import reach

from driving import straight

pytestmark = pytest.mark.cores(2)
SIZES = 1, 4, 16, 64, 256, 1024, 4096


@pytest.mark.asked("each of 4096 in at most 0.5 ms")
@pytest.mark.parametrize("size", SIZES)
def test_batch(benchmark, networks, size):
    plan_spread(benchmark, networks, circle(networks.arm), size)


def test_largest_batch_past_two_obstacles(benchmark, networks):
    plan_spread(benchmark, networks, reach(networks.arm, "risk-a"), SIZES[-1])


def plan_spread(benchmark, networks, task, size: int) -> None:
    """Plans of so many arms at rest, towards goals spread over a task."""
    step = s2c2a_strategy(networks).planner.step
    advance = jax.jit(jax.vmap(step.next_plan))
    places = np.linspace(0, len(task.goals) - 1, size).astype(int)
    goals = Goal.stacked([task.goals[place] for place in places])
    if not goals.thresholds.any():
        goals = goals.with_rows(slice(0))
    sensed = np.tile(straight(len(task.goals[0].positions)), (size, 1, 1))
    plans = jax.jit(jax.vmap(step.started))(sensed)

    def plan():
        return jax.block_until_ready(advance(plans, sensed, goals))

    benchmark.pedantic(plan, rounds=5, warmup_rounds=1)
    if benchmark.stats:
        benchmark.extra_info["each [ms]"] = 1e3 * benchmark.stats.stats.median / size
