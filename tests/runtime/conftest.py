"""Minimal robot and driver, and a clock that tests advance, as fixtures."""

import pytest
from puppets import Actor, ManualClock, Puppet  # type: ignore[import-not-found]

from s2c2a.runtime import Loop


@pytest.fixture
def clock():
    """Clock at zero."""
    return ManualClock()


@pytest.fixture
def puppet(twin, clock):
    """Real robot on that clock."""
    return Puppet(twin, clock)


@pytest.fixture
def actor(twin):
    """Driver of the robot."""
    return Actor(twin)


@pytest.fixture
def loop(puppet, actor, clock):
    """Loop with an open robot."""
    loop = Loop(puppet, actor, clock)
    loop.open()
    return loop
