"""What tests of hostile input share."""

import pytest

from s2c2a.data import CollectOptions, collect
from s2c2a.robots.simulation import SimulatedRobot

SMALL = CollectOptions(episodes=5, samples=12, seed=3)


@pytest.fixture
def gather(twin, tmp_path):
    """Collects a few short episodes from the twin into a file."""

    def make(seed):
        return SimulatedRobot(twin, seed=seed)

    return lambda name, **changes: collect(
        tmp_path / name, twin, make, SMALL, **changes
    )
