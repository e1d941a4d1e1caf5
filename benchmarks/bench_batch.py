"""Batched plans of 1 to 4096 arms at rest; `--device gpu` uses a GPU."""

import jax
import numpy as np
import pytest

from s2c2a.execution.executors import all_cores
from s2c2a.planning import Goal
from s2c2a.planning.batch import CHUNK
from s2c2a.strategies import s2c2a_batch_planner
from s2c2a.tasks import circle
from s2c2a.tasks.lines import reach

from driving import straight

pytestmark = pytest.mark.cores(2)
SIZES = 1, 4, 16, 64, 256, 1024, 4096
CHUNK_ON_GPU = 4096


@pytest.mark.asked("each of 4096 in at most 0.5 ms")
@pytest.mark.parametrize("size", SIZES)
def test_batch(benchmark, networks, size):
    plan_spread(benchmark, networks, circle(networks.arm), size)


def test_largest_batch_past_two_obstacles(benchmark, networks):
    plan_spread(benchmark, networks, reach(networks.arm, "risk-a"), SIZES[-1])


def plan_spread(benchmark, networks, task, size: int) -> None:
    """Plans of so many arms at rest, towards goals spread over a task."""
    chunk = CHUNK if jax.default_backend() == "cpu" else CHUNK_ON_GPU
    planner = s2c2a_batch_planner(networks, chunk=chunk, threads=all_cores())
    goals = Goal.stacked(
        [
            task.goals[place]
            for place in np.linspace(0, len(task.goals) - 1, size).astype(int)
        ]
    )
    sensed = np.tile(straight(len(task.goals[0].positions)), (size, 1, 1))
    plans = planner.start(sensed)
    benchmark.pedantic(
        planner.plan, args=(plans, sensed, goals), rounds=5, warmup_rounds=1
    )
    if benchmark.stats:
        benchmark.extra_info["each [ms]"] = 1e3 * benchmark.stats.stats.median / size
