"""One control step: sensing, planning, control, and all three together."""

import operator
from collections.abc import Callable, Iterator
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from s2c2a.bench.measurement import Limit, Measurement, timing
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.timing import Call, Progress, taken_in_turn
from s2c2a.control import Controller, CorrectedController, InversePCC, NetworkController
from s2c2a.experiments.workshop import Workshop
from s2c2a.kinematics import PCC
from s2c2a.programs import compiled
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading
from s2c2a.strategies import AnyStrategy, TrainedNetworks, recipe_named, s2c2a_strategy
from s2c2a.tasks import Task, circle
from s2c2a.tasks.obstacles import reach

ACT_LIMIT, TICK_LIMIT = Limit(0.15e-3), Limit(2e-3, 4e-3)
WATCHED = 200  # control steps whose readings are played again


def measure(options: BenchOptions, progress: Progress) -> Iterator[Measurement]:
    """Both recipes: each part of a tick, then whole ticks, free and past obstacles."""
    workshop = Workshop(progress=progress)
    for recipe in ("best", "paper"):
        networks = workshop.networks(options.arm, recipe_named(recipe), options.seed)
        yield from parts_of_a_tick(networks, options.repeats, partial(progress, f"parts of a tick, {recipe}"))
        yield from whole_ticks(networks, options.repeats, partial(progress, f"whole ticks, {recipe}"))


def parts_of_a_tick(
    networks: TrainedNetworks, repeats: int, progress: Callable[[int, int], None]
) -> Iterator[Measurement]:
    """Sensing, the learned controller as the recipe has it, and inverse PCC. Planning has a part of its own."""
    arm, recipe = networks.arm, networks.recipe
    with SimulatedRobot(arm) as robot:
        reading = robot.read()
    cables, truth = reading.cables.astype(np.float32), np.asarray(reading.configurations, np.float32)
    sense = compiled(operator.call, recipe.estimator(arm))
    sensed = sense(cables, truth)
    controller: Controller = NetworkController(networks.c2a)
    if recipe.correction:
        controller = CorrectedController(controller, recipe.correction)
    inverse = InversePCC(PCC.of(arm), jnp.ones(arm.module_count))
    calls = {
        "sense": lambda _: jax.block_until_ready(sense(cables, truth)),
        "C2A": _acting(controller, sensed),
        "inverse PCC": _acting(inverse, sensed),
    }
    times = taken_in_turn(calls, repeats, progress)
    for name, limit in (("sense", None), ("C2A", ACT_LIMIT), ("inverse PCC", None)):
        yield timing(f"{name}, {recipe.name}", times[name], limit)


def _acting(controller: Controller, sensed) -> Call:
    act, memory = compiled(_act, controller), controller.start(sensed)
    return lambda _: jax.block_until_ready(act(sensed, sensed, memory))


def _act(controller: Controller, wanted, sensed, memory):
    return controller.act(wanted, sensed, memory)


def whole_ticks(networks: TrainedNetworks, repeats: int, progress: Callable[[int, int], None]) -> Iterator[Measurement]:
    """Ticks of three strategies in turn: free, past two obstacles, past them with the whole arm guarded."""
    free, past = circle(networks.arm), reach(networks.arm, "risk-a")
    tip, whole = s2c2a_strategy(networks), s2c2a_strategy(networks, guard="arm")
    calls = {
        "whole tick": ticking(tip, free, seen_on(networks, free)),
        "past two obstacles": ticking(s2c2a_strategy(networks), past, seen_on(networks, past)),
        "past them, whole arm guarded": ticking(whole, past, seen_on(networks, past)),
    }
    times = taken_in_turn(calls, repeats, progress)
    for name, seconds in times.items():
        yield timing(f"{name}, {networks.recipe.name}", seconds, TICK_LIMIT)


def seen_on(networks: TrainedNetworks, task: Task, steps: int = WATCHED) -> list[Reading]:
    """Readings of the simulated arm on a task, rest first."""
    strategy = s2c2a_strategy(networks)
    with SimulatedRobot(networks.arm) as robot:
        readings = [robot.read()]
        strategy.start(readings[0])
        for goal in task.goals[:steps]:
            robot.send(strategy.step(readings[-1], goal))
            readings.append(robot.read())
    return readings[:-1]


def ticking(strategy: AnyStrategy, task: Task, readings: list[Reading]) -> Call:
    """A call that does one control step: readings of a run and its goals, again and again."""
    strategy.start(readings[0])

    def call(number: int) -> np.ndarray:
        place = number % len(readings)
        return strategy.step(readings[place], task.goals[place])

    return call
