"""Simulation of a babbling arm by fidelity and threads, and its error at rest."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.data import episode_actions
from s2c2a.execution.executors import all_cores
from s2c2a.robots.simulation import SimulatedRobot

from driving import hold
from simulator_accuracy import static_errors

pytestmark = pytest.mark.cores(2)
STEPS = {"fast": 200, "accurate": 40}  # control steps a round and thread


@pytest.fixture(scope="module")
def errors():
    """Every rod case in every fidelity."""
    return static_errors()


@pytest.mark.asked("one thread: fast at least 250 arm seconds a second, accurate 25")
@pytest.mark.parametrize("crowd", ["one thread", "every core"])
@pytest.mark.parametrize("fidelity", STEPS)
def test_simulate(benchmark, arm, errors, fidelity, crowd):
    steps = STEPS[fidelity]
    threads = 1 if crowd == "one thread" else all_cores()
    babbles = [
        episode_actions(ArmGeometry.of(arm), "motor", n, threads, steps, 0)
        for n in range(threads)
    ]
    robots = [SimulatedRobot(arm, fidelity, number) for number in range(threads)]
    for robot in robots:
        robot.open()
    with ThreadPoolExecutor(threads) as pool:
        benchmark.pedantic(
            lambda: list(pool.map(hold_all, robots, babbles)),
            rounds=20,
            warmup_rounds=2,
        )
    if benchmark.stats:
        speed = threads * steps * arm.control_period / benchmark.stats.stats.median
        benchmark.extra_info["arm seconds a second"] = speed
    worst = max(each.error for each in errors if each.fidelity == fidelity)
    benchmark.extra_info["largest error at rest over the rod cases [mm]"] = 1e3 * worst


def hold_all(robot: SimulatedRobot, actions) -> None:
    for action in actions:
        hold(robot, action)
