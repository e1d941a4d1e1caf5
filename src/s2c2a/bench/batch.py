"""Many plans in one call: how the time grows from one to 4096."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import jax
import numpy as np

from s2c2a.bench.measurement import Growth, Limit, Measurement, growing, timing
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.plan import straight
from s2c2a.bench.timing import Call, Progress, taken_in_turn
from s2c2a.experiments.workshop import Workshop
from s2c2a.planning import BatchPlanner, Goal
from s2c2a.planning.batch import CHUNK
from s2c2a.shards import all_cores
from s2c2a.strategies import TrainedNetworks, recipe_named, s2c2a_batch_planner
from s2c2a.tasks import Task, circle
from s2c2a.tasks.obstacles import reach

SIZES, FEW_SIZES = (1, 4, 16, 64, 256, 1024, 4096), (1, 64, 256)
EACH_LIMIT = Limit(0.5e-3)
CHUNK_ON_GPU = 4096


def measure(options: BenchOptions, progress: Progress) -> Iterator[Measurement | Growth]:
    """Both recipes: targets around the circle, then past two obstacles."""
    workshop = Workshop(progress=progress)
    sizes = FEW_SIZES if options.quick else SIZES
    for recipe in ("best", "paper"):
        networks = workshop.networks(options.arm, recipe_named(recipe), options.seed)
        yield from batches(networks, sizes, options.long_repeats, partial(progress, f"batches, {recipe}"))


def batches(
    networks: TrainedNetworks, sizes: Sequence[int], repeats: int, progress: Callable[[int, int], None]
) -> Iterator[Measurement | Growth]:
    """Batches of all sizes in turn, and the largest one past obstacles."""
    recipe, largest = networks.recipe.name, sizes[-1]
    chunk = CHUNK if jax.default_backend() == "cpu" else CHUNK_ON_GPU
    planner = s2c2a_batch_planner(networks, chunk=chunk, threads=all_cores())
    free, past = circle(networks.arm), reach(networks.arm, "risk-a")
    calls = {str(size): _planning(planner, free, size) for size in sizes}
    calls["past"] = _planning(planner, past, largest)
    *times, among = taken_in_turn(calls, repeats, progress).values()
    yield timing(f"each of {largest} plans in one batch, {recipe}", times[-1] / largest, EACH_LIMIT)
    yield timing(f"each of {largest} past two obstacles, {recipe}", among / largest)
    yield from growing("plans in a batch", f"a batch, {recipe}", sizes, times)


def _planning(planner: BatchPlanner, task: Task, count: int) -> Call:
    """Plans of so many arms at rest, towards goals spread over a task."""
    picked = np.linspace(0, len(task.goals) - 1, count).astype(int)
    goals = Goal.stacked([task.goals[place] for place in picked])
    sensed = np.tile(straight(len(task.goals[0].positions)), (count, 1, 1))
    plans = planner.start(sensed)
    return lambda _: planner.plan(plans, sensed, goals)
