"""How fast it is here: median and 99th percentile of what happens in every control step, and of the long work."""

import operator
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import jax
import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.control import NetworkController
from s2c2a.data import CollectOptions
from s2c2a.errors import S2C2AError
from s2c2a.experiments.workshop import Progress, Workshop
from s2c2a.planning import Planner
from s2c2a.programs import compiled
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import Recipe, TrainedNetworks, s2c2a_strategy
from s2c2a.strategies.scale import planning_scale
from s2c2a.tasks import circle
from s2c2a.tasks.obstacles import reach

REPEATS = 1000


@dataclass(frozen=True)
class Timing:
    """How long a thing took [s], over `repeats` times."""

    what: str
    median: float
    percentile_99: float
    repeats: int


def timed(what: str, call: Callable[[int], object], repeats: int) -> Timing:
    """Time a call that takes the number of the repeat; a tenth as many calls before are not counted."""
    for number in range(max(1, repeats // 10)):
        call(number)
    took = np.empty(repeats)
    for number in range(repeats):
        began = time.perf_counter()
        jax.block_until_ready(call(number))
        took[number] = time.perf_counter() - began
    return Timing(what, float(np.median(took)), float(np.percentile(took, 99)), repeats)


def step_timings(networks: TrainedNetworks, repeats: int = REPEATS) -> list[Timing]:
    """Sense, plan, act, the three together, and one step of the simulated arm.

    Raises:
        S2C2AError: fewer than one repeat.
    """
    if repeats < 1:
        raise S2C2AError(f"{repeats} repeats asked for; take at least one")
    arm = networks.arm
    with SimulatedRobot(arm) as robot:
        reading = robot.read()
        goals = circle(arm).goals
        sense = compiled(operator.call, networks.recipe.estimator(arm))
        cables, truth = reading.cables.astype(np.float32), np.asarray(reading.configurations, np.float32)
        planner = Planner(arm, networks.c2s, planning_scale(arm), networks.recipe.planner)
        controller = NetworkController(networks.c2a)
        sensed = sense(cables, truth)
        plan, memory = planner.start(sensed), controller.start(sensed)
        act = compiled(NetworkController.act, controller)
        strategy = s2c2a_strategy(networks)
        strategy.start(reading)
        action = strategy.step(reading, goals[0])
        avoiding = reach(arm, "risk-a").goals
        guarded = s2c2a_strategy(networks, guard="arm")
        guarded.start(reading)
        return [
            timed("sense", lambda n: sense(cables, truth), repeats),
            timed("plan", lambda n: planner.plan(plan, sensed, goals[n % len(goals)]), repeats),
            timed("act", lambda n: act(sensed, sensed, memory), repeats),
            timed("tick: sense, plan, act", lambda n: strategy.step(reading, goals[n % len(goals)]), repeats),
            timed("tick past two obstacles", lambda n: strategy.step(reading, avoiding[n % len(avoiding)]), repeats),
            timed("the same, whole arm guarded", lambda n: guarded.step(reading, avoiding[n % len(avoiding)]), repeats),
            timed("simulated control step, fast", lambda n: robot.send(action), min(repeats, 200)),
        ]


def work_timings(arm: ArmSpec, recipe: Recipe, progress: Progress) -> tuple[list[Timing], TrainedNetworks]:
    """Collecting 9000 samples and training both networks from nothing: as a whole, and by episodes and epochs."""
    marks: dict[str, list[tuple[float, int]]] = {}

    def told(doing: str, done: int, total: int) -> None:
        marks.setdefault(doing.split(" ")[0], []).append((time.perf_counter(), done))
        progress(doing, done, total)

    with TemporaryDirectory() as folder:
        workshop = Workshop(Path(folder), progress=told)
        began = time.perf_counter()
        workshop.recording(arm, CollectOptions(speeds=recipe.speeds))
        collected = time.perf_counter()
        networks = workshop.networks(arm, recipe, seed=0)
        trained = time.perf_counter()
    whole = {"collecting 9000 samples": collected - began, "training both networks": trained - collected}
    timings = [Timing(what, took, took, 1) for what, took in whole.items()]
    parts = (_parts(marks["collecting"], "an episode"), _parts(marks["training"], "an epoch"))
    return [*timings, *parts], networks


def _parts(marks: list[tuple[float, int]], what: str) -> Timing:
    """Time of one part of long work, from when how many parts were done."""
    each = [(t1 - t0) / (n1 - n0) for (t0, n0), (t1, n1) in pairwise(marks) if n1 > n0]
    return Timing(what, float(np.median(each)), float(np.percentile(each, 99)), len(each))
