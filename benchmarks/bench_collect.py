"""Whole recordings as a user collects them, file and all."""

import pytest

from s2c2a.data import collect
from s2c2a.execution.executors import all_cores
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import recipe_named

pytestmark = pytest.mark.cores(2)


@pytest.mark.asked("at most 8 s")
def test_9000_samples(benchmark, arm, tmp_path):
    how = recipe_named("best").collect_options()
    cores = all_cores()
    assert how.episodes * how.samples == 9000

    def make_robot(seed: int) -> SimulatedRobot:
        return SimulatedRobot(arm, "fast", seed)

    file = tmp_path / "recording.episodes"
    benchmark.pedantic(
        lambda: collect(file, arm, make_robot, how, threads=cores, overwrite=True),
        rounds=5,
    )
