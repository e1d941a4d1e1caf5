import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.goals import Goal
from s2c2a.kinematics import states_from_bends
from s2c2a.spaces import POSITION
from s2c2a.strategies import RECIPES, RunOptions
from s2c2a_experiments.planners.potential_field import PotentialField

from ideal_arm import drive_ideal

BENDS = np.array([[0.2, 0.1], [0.1, -0.1], [-0.1, 0.2]], np.float32)
STEPS = 30


@pytest.fixture(scope="module")
def twin():
    return load_arm("twin_arm")


@pytest.fixture(scope="module")
def driver(twin):
    return PotentialField().build(twin, RECIPES["best"], None, RunOptions("arm"))


@pytest.fixture(scope="module")
def target(twin):
    lengths = ArmGeometry.of(twin).lengths.astype(np.float32)
    return np.asarray(states_from_bends(BENDS, lengths))[-1, POSITION]


@pytest.mark.slow
def test_beetles_reach_the_target_the_same_way_every_time(driver, twin, target):
    goals = [Goal.of(3).with_position(target)] * STEPS
    bends, states = drive_ideal(driver, twin, goals)
    again, _ = drive_ideal(driver, twin, goals)
    assert np.linalg.norm(states[-1, -1, POSITION] - target) < 0.01
    np.testing.assert_array_equal(again, bends)


def test_an_obstacle_around_the_target_repels_the_arm(driver, twin, target):
    goal = Goal.of(3).with_position(target).with_obstacles([target], [0.05])
    _, states = drive_ideal(driver, twin, [goal] * STEPS)
    gap = np.linalg.norm(states[-1, -1, POSITION] - target)
    assert 0.05 <= gap < 0.15


def test_without_targets_the_arm_holds_still(driver, twin):
    bends, _ = drive_ideal(driver, twin, [Goal.of(3)] * 3)
    np.testing.assert_allclose(bends, 0.0, atol=1e-4)
