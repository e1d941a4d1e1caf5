"""Growth of times with modules, cables, obstacles, waypoints (untrained networks)."""

import time

import jax
import numpy as np
import pytest

from s2c2a.arm import ArmSpec
from s2c2a.strategies import s2c2a_strategy
from s2c2a.tasks import circle, load_waypoints, unreachable_waypoints, waypoints_task

from driving import at_rest, following, planner_of, ticking, untrained

MODULES = (1, 2, 3, 5, 10, 20)
CABLES = (3, 4, 6, 8)
OBSTACLES = (0, 1, 2, 4, 8, 16, 32, 64)
WAYPOINTS = (100, 1000, 10_000, 100_000)
ROUNDS = 200
either_recipe = pytest.mark.parametrize("recipe", ["best", "paper"])
plan_or_tick = pytest.mark.parametrize("what", ["plan", "tick"])


@pytest.mark.asked("plans: exponent at most 1")
@plan_or_tick
@either_recipe
@pytest.mark.parametrize("size", MODULES)
def test_modules(benchmark, arm, size, recipe, what):
    grow(benchmark, arm_of_modules(arm, size), recipe, what)


@plan_or_tick
@either_recipe
@pytest.mark.parametrize("size", CABLES)
def test_cables(benchmark, arm, size, recipe, what):
    grow(benchmark, arm_of_cables(arm, size), recipe, what)


@pytest.mark.asked("exponent at most 1")
@either_recipe
@pytest.mark.parametrize("size", OBSTACLES)
def test_obstacles(benchmark, arm, size, recipe):
    plan = following(planner_of(untrained(arm, recipe)), among_obstacles(arm, size))
    benchmark.pedantic(plan, rounds=ROUNDS, warmup_rounds=20)


@pytest.mark.parametrize("size", WAYPOINTS)
def test_waypoints_read(benchmark, arm, size, tmp_path):
    path = waypoints_file(tmp_path / "waypoints.csv", arm, size)
    benchmark.pedantic(
        lambda: waypoints_task(path.stem, load_waypoints(path), arm),
        rounds=3,
        warmup_rounds=1,
    )


@pytest.mark.parametrize("size", WAYPOINTS)
def test_waypoints_checked(benchmark, arm, size, tmp_path):
    path = waypoints_file(tmp_path / "waypoints.csv", arm, size)
    benchmark.pedantic(
        lambda: unreachable_waypoints(load_waypoints(path), arm),
        rounds=3,
        warmup_rounds=1,
    )


def grow(benchmark, arm: ArmSpec, recipe: str, what: str) -> None:
    """A plan or a tick of an arm; what compiling takes stands beside it."""
    goals = circle(arm).goals
    began = time.perf_counter()
    networks = untrained(arm, recipe)
    tick = (
        ticking(s2c2a_strategy(networks), goals, [at_rest(arm)] * len(goals))
        if what == "tick"
        else None
    )
    call = tick or following(planner_of(networks), goals)
    benchmark.extra_info["compiling [s]"] = time.perf_counter() - began
    benchmark.pedantic(call, rounds=ROUNDS, warmup_rounds=20)
    jax.clear_caches()


def arm_of_modules(arm: ArmSpec, count: int) -> ArmSpec:
    """The arm with its modules repeated and shortened, so that its length stays."""
    kinds = [arm.modules[number % arm.module_count] for number in range(count)]
    scale = arm.length / sum(module.length for module in kinds)
    return changed(
        arm,
        [
            module.model_copy(update={"length": scale * module.length})
            for module in kinds
        ],
    )


def arm_of_cables(arm: ArmSpec, count: int) -> ArmSpec:
    """The arm with this many cables in every module, evenly spread."""
    angles = [
        module.cable_angles_deg[0] + 360.0 * np.arange(count) / count
        for module in arm.modules
    ]
    pairs = zip(arm.modules, angles, strict=True)
    return changed(
        arm,
        [
            module.model_copy(update={"cable_angles_deg": tuple(each.tolist())})
            for module, each in pairs
        ],
    )


def changed(arm: ArmSpec, modules: list) -> ArmSpec:
    """The arm with other modules, validated, and without its sensing coupling."""
    values = arm.model_dump() | {
        "sensing_coupling": None,
        "modules": [module.model_dump() for module in modules],
    }
    return ArmSpec.model_validate(values)


def among_obstacles(arm: ArmSpec, count: int):
    """The circle with obstacles around it that leave a path for the tip."""
    directions = np.random.default_rng(0).normal(size=(64, 3))
    centers = (
        arm.length * directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    )
    thresholds = np.full(64, 0.02 * arm.length)
    return [
        goal.with_obstacles(centers[:count], thresholds[:count])
        for goal in circle(arm).goals
    ]


def waypoints_file(path, arm: ArmSpec, count: int):
    """The circle at so many control steps."""
    positions = circle(arm).desired_positions()[:, -1]
    times = np.arange(1, count + 1) / arm.control_rate
    rows = np.column_stack([times, positions[np.arange(count) % len(positions)]])
    np.savetxt(path, rows, fmt="%.6f", delimiter=",", header="time,x,y,z", comments="")
    return path
