"""Several inverse solutions and the choice among them."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.goals import Goal
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a_experiments.planners.multiple_solutions import (
    MultipleSolutions,
    best_sequence,
)

from ideal_arm import drive_ideal

OPTIONS = MultipleSolutions(solutions=4)
TARGET = np.array([0.25, 0.0, 0.9])  # of the arm's length, in the plane of the finger


def driver_for(arm):
    return OPTIONS.build(arm, recipe_named("paper"), None, RunOptions())


@pytest.fixture(scope="module")
def finger():
    return load_arm("planar_finger")


@pytest.fixture(scope="module")
def driver(finger):
    return driver_for(finger)


@pytest.mark.slow
def test_it_reaches_a_target_and_holds_still_without_one(driver, finger):
    goal = Goal.of(finger.module_count).with_position(finger.length * TARGET)
    resting = Goal.of(finger.module_count)
    bends, states = drive_ideal(driver, finger, [goal] * 25 + [resting] * 3)
    np.testing.assert_allclose(states[24, -1, :3], goal.positions[-1], atol=1e-3)
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


def test_the_best_sequence_pays_now_for_what_is_cheap_later():
    """Zero and one [rad]: the near one is free now, and costs much in the next moment."""
    shapes = np.zeros((2, 1, 2))
    shapes[1, 0, 0] = 1.0
    layers = [(shapes, np.array([0.0, 0.5])), (shapes, np.array([5.0, 0.0]))]
    chosen = best_sequence(shapes[0] + 0.4, layers)
    np.testing.assert_array_equal(chosen, [shapes[1], shapes[1]])
