"""Calls for the benchmarks: sequences of plans, control steps, and simulated arms.

Whatever benchmarks ask of robots, readings, planners and strategies stands here.
"""

from collections.abc import Callable, Sequence
from importlib import import_module
from itertools import cycle
from types import ModuleType

import equinox as eqx
import jax
import numpy as np
import pytest

from s2c2a.arm import ArmSpec
from s2c2a.estimation import Estimate
from s2c2a.goals import Goal
from s2c2a.planning import Planner
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading
from s2c2a.strategies import Strategy, TrainedNetworks, recipe_named, s2c2a_strategy
from s2c2a.tasks import Task
from s2c2a.training import Trained

Call = Callable[[], object]
WATCHED = 200  # control steps whose readings are played again


def module_with(package: str, module: str) -> ModuleType:
    """Import a module of this folder, or skip the benchmark without its package."""
    pytest.importorskip(
        package, reason=f"{package} is not installed: `pip install '.[bench]'`"
    )
    return import_module(module)


def hold(robot: SimulatedRobot, action: np.ndarray) -> None:
    """Simulate one control step."""
    robot.step(action)


def at_rest(arm: ArmSpec) -> Reading:
    """What a straight arm reads."""
    cables = np.zeros((arm.module_count, arm.cable_count))
    return Reading(
        0.0, {"cables": cables, "configurations": straight(arm.module_count)}
    )


def straight(modules: int) -> np.ndarray:
    """The configuration of a straight arm, shape (modules, 3)."""
    return np.tile(np.array([0.0, 0.0, 1.0], np.float32), (modules, 1))


def untrained(arm: ArmSpec, recipe: str) -> TrainedNetworks:
    """Networks of the recipe's shapes; speed asks for no more."""
    chosen = recipe_named(recipe)
    networks = eqx.filter_jit(chosen.untrained)(arm, jax.random.key(0))
    trained = {name: Trained(network) for name, network in networks.items()}
    return TrainedNetworks(arm, chosen, 0, trained)


def planner_of(networks: TrainedNetworks) -> Planner:
    """The planner of a recipe, the tip guarded."""
    return Planner(networks.arm, networks.c2s, networks.recipe.planner)


def following(planner: Planner, goals: Sequence[Goal]) -> Call:
    """A call that plans for each goal in turn from the last plan, with ideal sensing."""
    plan = planner.start(Estimate(straight(len(goals[0].positions))))
    asked = cycle(goals)

    def call() -> None:
        nonlocal plan
        plan = jax.block_until_ready(
            planner.plan(plan, Estimate(plan.configurations), next(asked))
        )

    return call


def ticking(
    strategy: Strategy, goals: Sequence[Goal], readings: Sequence[Reading]
) -> Call:
    """A call that does one control step: readings and their goals, again and again."""
    strategy.planner.set_real_time(True)
    strategy.start(readings[0])
    pairs = cycle(zip(readings, goals, strict=False))
    return lambda: strategy.step(*next(pairs))


def ticks_on(networks: TrainedNetworks, task: Task, guard="tip") -> Call:
    """Control steps on the readings of a simulated run, with the tip guarded."""
    strategy = s2c2a_strategy(networks)
    with SimulatedRobot(networks.arm) as robot:
        readings = [robot.read()]
        strategy.start(readings[0])
        for goal in task.goals[:WATCHED]:
            hold(robot, strategy.step(readings[-1], goal))
            readings.append(robot.read())
    return ticking(s2c2a_strategy(networks, guard), task.goals, readings[:-1])


def times_over(call: Call, count: int) -> Call:
    """The call so many times."""

    def all_of_them() -> None:
        for _ in range(count):
            call()

    return all_of_them
