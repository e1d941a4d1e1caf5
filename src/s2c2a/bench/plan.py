"""One plan: against the paper's own way, and what the room for obstacles costs."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import jax
import numpy as np

from s2c2a.bench.extras import MissingExtraError, module_with
from s2c2a.bench.measurement import Limit, Measurement, Skipped, ratio, timing
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.timing import Call, Progress, taken_in_turn
from s2c2a.experiments.workshop import Workshop
from s2c2a.planning import Goal, LeastSquaresOptions, Plan, Planner
from s2c2a.planning.residuals import OBSTACLES_AT_HAND
from s2c2a.strategies import TrainedNetworks, recipe_named
from s2c2a.strategies.scale import planning_scale
from s2c2a.tasks import circle

PLAN_LIMIT, FASTER, ROOM = Limit(1.3e-3), Limit(15.0, at_least=True), Limit(1.10)
SAME = Limit(1e-4)
COMPARED = 50  # plans
AT_A_TIME = 10  # PyTorch leaves the caches to nobody: a single plan after it takes twice as long


def measure(options: BenchOptions, progress: Progress) -> Iterator[Measurement | Skipped]:
    """The paper's recipe beside eager PyTorch, then both recipes with and without room for obstacles."""
    workshop = Workshop(progress=progress)
    for recipe in ("paper", "best"):
        networks = workshop.networks(options.arm, recipe_named(recipe), options.seed)
        told = partial(progress, f"planning, {recipe}")
        if recipe == "paper":
            yield from against_torch(networks, options.repeats, partial(progress, "planning, PyTorch beside it"))
        yield from room_for_obstacles(networks, options.repeats, told)


def planner_of(networks: TrainedNetworks) -> Planner:
    """The planner of a recipe, the tip guarded."""
    return Planner(networks.arm, networks.c2s, planning_scale(networks.arm), networks.recipe.planner)


def following(planner: Planner, goals: Sequence[Goal]) -> Call:
    """A call that plans for one goal after the other, each from the last plan, the sensors agreeing with it."""
    plan = planner.start(straight(goals[0].positions.shape[0]))

    def call(number: int) -> Plan:
        nonlocal plan
        plan = jax.block_until_ready(planner.plan(plan, plan.configurations, goals[number % len(goals)]))
        return plan

    return call


def straight(modules: int) -> np.ndarray:
    """The configuration of a straight arm, shape (modules, 3)."""
    return np.tile(np.array([0.0, 0.0, 1.0], np.float32), (modules, 1))


def against_torch(
    networks: TrainedNetworks, repeats: int, progress: Callable[[int, int], None]
) -> Iterator[Measurement | Skipped]:
    """Around the circle with the same weights: the same plans, ours compiled and PyTorch's eager, in turn."""
    planner, goals = planner_of(networks), circle(networks.arm).goals
    try:
        torch_planner = module_with("torch", "torch_planner")
    except MissingExtraError as missing:
        yield timing("one plan, paper", taken_in_turn({"": following(planner, goals)}, repeats)[""], PLAN_LIMIT)
        yield Skipped("one plan against eager PyTorch", str(missing))
        return
    yield Measurement(
        "largest difference from PyTorch's plans", "1", _difference(networks, torch_planner), None, COMPARED, SAME
    )
    calls = {"ours": following(planner, goals), "torch": torch_planner.following(networks, goals)}
    times = taken_in_turn(calls, repeats, progress, at_a_time=AT_A_TIME)
    yield timing("one plan, paper", times["ours"], PLAN_LIMIT)
    yield timing("one plan, paper, eager PyTorch", times["torch"])
    yield ratio("one plan: PyTorch over ours", times["torch"], times["ours"], FASTER)


def _difference(networks: TrainedNetworks, torch_planner) -> float:
    """Largest difference of any number in plans that begin alike."""
    goals = circle(networks.arm).goals
    planner, theirs = planner_of(networks), torch_planner.planner_of(networks)
    plan = planner.start(straight(networks.arm.module_count))
    worst = 0.0
    for goal in goals[:: max(1, len(goals) // COMPARED)][:COMPARED]:
        last = plan.configurations
        plan = planner.plan(plan, last, goal)
        planned = theirs.plan(torch_planner.tensor(last), torch_planner.TorchGoal.of(goal)).numpy()
        worst = max(worst, float(np.abs(planned - np.asarray(plan.configurations)).max()))
    return worst


def room_for_obstacles(
    networks: TrainedNetworks, repeats: int, progress: Callable[[int, int], None]
) -> Iterator[Measurement]:
    """With no obstacle in use: room for as many as a goal holds, against the least room that the planner takes."""
    planner, goals, recipe = planner_of(networks), circle(networks.arm).goals, networks.recipe.name
    least = OBSTACLES_AT_HAND if isinstance(networks.recipe.planner, LeastSquaresOptions) else 0
    small = [_with_room(goal, least) for goal in goals]
    room = len(goals[0].thresholds)
    times = taken_in_turn({"all": following(planner, goals), "least": following(planner, small)}, repeats, progress)
    yield timing(f"one plan, {recipe}, room for {room} obstacles, none in use", times["all"], PLAN_LIMIT)
    yield timing(f"one plan, {recipe}, room for {least}", times["least"])
    yield ratio(f"{recipe}: room for {room} over room for {least}", times["all"], times["least"], ROOM)


def _with_room(goal: Goal, room: int) -> Goal:
    return goal._replace(obstacles=goal.obstacles[:room], thresholds=goal.thresholds[:room])
