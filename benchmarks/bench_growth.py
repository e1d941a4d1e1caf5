"""Growth of times with modules, obstacles, waypoints (untrained networks)."""

import numpy as np
import pytest

from s2c2a.arm import ArmSpec
from s2c2a.tasks import circle, load_waypoints, unreachable_waypoints, waypoints_task

from driving import following, planner_of, untrained

MODULES = (1, 2, 3, 5, 10, 20)
OBSTACLES = (0, 1, 2, 4, 8, 16, 32, 64)
WAYPOINTS = (100, 1000, 10_000, 100_000)
ROUNDS = 200
either_recipe = pytest.mark.parametrize("recipe", ["best", "paper"])


@pytest.mark.asked("exponent at most 1")
@either_recipe
@pytest.mark.parametrize("size", MODULES)
def test_modules(benchmark, arm, size, recipe):
    longer = arm_of_modules(arm, size)
    plan = following(planner_of(untrained(longer, recipe)), circle(longer).goals)
    benchmark.pedantic(plan, rounds=ROUNDS, warmup_rounds=20)


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
