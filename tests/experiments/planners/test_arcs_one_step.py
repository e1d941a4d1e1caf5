from functools import cache

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.goals import Goal
from s2c2a.kinematics import states_from_bends
from s2c2a.spaces import AXIS, POSITION
from s2c2a.strategies import RECIPES, RunOptions
from s2c2a_experiments.planners.arcs_one_step import ArcsOneStep

from ideal_arm import drive_ideal

BENDS = np.array([[0.3, 0.1], [0.2, -0.2], [-0.1, 0.4]], np.float32)


@pytest.fixture(scope="module")
def twin():
    return load_arm("twin_arm")


@cache
def built(arm):
    return ArcsOneStep().build(arm, RECIPES["best"], None, RunOptions("arm"))


def states_at(arm, bends):
    lengths = ArmGeometry.of(arm).lengths.astype(np.float32)
    return np.asarray(states_from_bends(bends, lengths))


@pytest.mark.slow
def test_ideal_arcs_reach_tip_and_axis(twin):
    target = states_at(twin, BENDS)[-1]
    goal = Goal.of(3).with_position(target[POSITION]).with_axis(target[AXIS])
    _, states = drive_ideal(built(twin), twin, [goal] * 40)
    np.testing.assert_allclose(states[-1, -1], target, atol=0.01)


def test_the_arm_stays_out_of_an_obstacle_before_its_target(twin):
    target = states_at(twin, BENDS)[-1, POSITION]
    goal = Goal.of(3).with_position(target).with_obstacles([target], [0.05])
    _, states = drive_ideal(built(twin), twin, [goal] * 40)
    gap = np.linalg.norm(states[-1, -1, POSITION] - target)
    assert 0.05 <= gap < 0.15


def test_without_targets_the_arm_holds_still(twin):
    bends, _ = drive_ideal(built(twin), twin, [Goal.of(3)] * 3)
    np.testing.assert_allclose(bends, 0.0, atol=1e-4)


@pytest.mark.slow
def test_an_arm_of_one_plane_reaches_what_it_can():
    finger = load_arm("planar_finger")
    count = finger.module_count
    bends = 0.2 * ArmGeometry.of(finger).bend_limits[:, None] * np.ones((count, 2))
    plane = ArmGeometry.of(finger).steerable
    target = states_at(finger, np.einsum("mij,mj->mi", plane, bends))[-1, POSITION]
    goal = Goal.of(count).with_position(target)
    _, states = drive_ideal(built(finger), finger, [goal] * 40)
    gap = np.linalg.norm(states[-1, -1, POSITION] - target)
    assert gap < 0.02 * finger.length
