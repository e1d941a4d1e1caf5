"""Samples of the redundant bends, whose other modules are solved."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.goals import Goal
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a_experiments.planners.inverse_sampling import InverseSampling, moved_modules

from ideal_arm import drive_ideal

OPTIONS = InverseSampling(samples=6)
TARGET = np.array([0.25, 0.0, 0.9])  # of the arm's length, in the plane of the finger


@pytest.fixture(scope="module")
def finger():
    return load_arm("planar_finger")


@pytest.fixture(scope="module")
def driver(finger):
    return OPTIONS.build(finger, recipe_named("paper"), None, RunOptions())


@pytest.mark.slow
def test_it_reaches_a_target_and_holds_still_without_one(driver, finger):
    goal = Goal.of(finger.module_count).with_position(finger.length * TARGET)
    resting = Goal.of(finger.module_count)
    bends, states = drive_ideal(driver, finger, [goal] * 25 + [resting] * 3)
    np.testing.assert_allclose(states[24, -1, :3], goal.positions[-1], atol=2e-3)
    np.testing.assert_allclose(bends[25:], bends[24:-1], atol=1e-4)


def test_its_tip_stays_outside_of_an_obstacle(driver, finger):
    target, radius = finger.length * TARGET, 0.1 * finger.length
    goal = Goal.of(finger.module_count).with_position(target)
    goal = goal.with_obstacles([target], [radius])
    _, states = drive_ideal(driver, finger, [goal] * 20)
    gaps = np.linalg.norm(states[:, -1, :3] - target, axis=-1)
    assert gaps.min() > radius + finger.modules[-1].radius


def test_it_plans_alike_twice(driver, finger):
    goal = Goal.of(finger.module_count).with_position(finger.length * TARGET)
    first, _ = drive_ideal(driver, finger, [goal] * 4)
    again, _ = drive_ideal(driver, finger, [goal] * 4)
    np.testing.assert_array_equal(first, again)


def test_an_axis_and_inner_ends_leave_less_to_samples():
    goal = Goal.of(4).with_position([0.0, 0.0, 1.0])
    np.testing.assert_array_equal(moved_modules(goal), [0, 0, 1, 1])
    np.testing.assert_array_equal(
        moved_modules(goal.with_axis([0, 0, 1])), [0, 1, 1, 1]
    )
    inner = goal.with_position([0.0, 0.0, 0.5], module=1)
    np.testing.assert_array_equal(moved_modules(inner), [1, 1, 1, 1])
