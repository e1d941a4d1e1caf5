"""How an arm swings: by its description against the simulated one, by load, and found again in what it did."""

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.estimation.modal_model import (
    RobotFactory,
    Swing,
    followed,
    identified_swing,
    modes,
    motion,
)
from s2c2a.robots.simulation import SimulatedRobot

PERIOD = 0.1


@pytest.fixture(scope="module")
def twin():
    return load_arm("twin_arm")


def ringing(arm, load) -> float:
    """Frequency of the tip of a straight arm after a push [Hz]."""
    robot = SimulatedRobot(arm, payload=load)
    robot.open()
    rest = robot.sensors["cables"].low * 0.0
    robot.push(np.array([0.1, 0.0, 0.0]))
    for _ in range(40):
        robot.step(rest)
    robot.push(np.zeros(3))
    ways = []
    for _ in range(500):
        robot.advance(0.01)
        ways.append(robot.states()[-1, 0])
    crossings = np.flatnonzero(np.diff(np.sign(np.array(ways) - np.mean(ways[-100:]))))
    return 0.5 / (np.diff(crossings[:8]).mean() * 0.01)


@pytest.mark.parametrize("load", [0.0, 0.05, 0.1])
def test_the_first_mode_is_that_of_the_simulated_arm_whatever_it_carries(twin, load):
    slowest = modes(
        motion(RobotFactory.of(twin), Swing.nominal(), load, PERIOD), PERIOD
    )[0, 0]
    assert slowest == pytest.approx(ringing(twin, load), rel=0.2)


def test_what_swings_comes_to_rest_where_it_should(twin):
    swinging = motion(RobotFactory.of(twin), Swing.nominal(), 0.0, PERIOD)
    desired = np.full(6, 0.1)
    state = np.zeros(12)
    for _ in range(300):
        state = swinging.steps @ state + swinging.inputs @ desired
    np.testing.assert_allclose(state, np.r_[desired, np.zeros(6)], atol=1e-6)


def test_factors_are_found_again_in_a_swing(twin):
    true = Swing(jnp.asarray(0.7), jnp.asarray(1.2))
    rests = np.repeat(np.random.default_rng(0).normal(0, 0.1, (3, 20, 6)), 10, axis=1)
    bends = followed(motion(RobotFactory.of(twin), true, 0.0, PERIOD), rests)
    shape = (3, 200, 3, 2)
    found, (without, left) = identified_swing(
        twin, rests.reshape(shape), bends.reshape(shape)
    )
    assert float(found.stiffness) == pytest.approx(0.7, rel=0.05)
    assert float(found.damping) == pytest.approx(1.2, rel=0.1)
    assert left < 0.1 * without


def test_where_bends_are_not_known_the_description_stands(twin):
    nothing = np.full((2, 100, 3, 2), np.nan)
    found, left = identified_swing(twin, np.zeros_like(nothing), nothing)
    assert (float(found.stiffness), *left) == (1.0, 0.0, 0.0)
