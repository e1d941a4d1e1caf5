"""What planners in bends have in common, on an arm of one plane and of few modules."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.goals import Goal
from s2c2a.kinematics import states_from_bends
from s2c2a.strategies import RunOptions, recipe_named, strategy_named

from ideal_arm import drive_ideal
from marks import slow_after

MULTI_IK = "multi-ik,solutions=4"
SAMPLING = "inverse-sampling,samples=6"
NEAR = {
    "biarc": 0.01,
    "drawn-curve": 0.01,
    "fuzzy": 0.1,
    "diff-ik": 0.02,
    "apf": 0.03,
    "pcc-one-step": 0.01,
    "online-jacobian": 0.04,
    MULTI_IK: 0.01,
    SAMPLING: 0.01,
    "rrt-star,neighbors=4,waiting=3": 0.01,
}
"""Planner -> distance from a target after 40 steps, in parts of the arm's length."""
FINGER = load_arm("planar_finger")
STILL = Goal.of(FINGER.module_count)


@pytest.fixture(scope="module")
def built():
    """Drivers of the finger by the name of their planner, each built once."""
    drivers = {}

    def build(name):
        if name not in drivers:
            options = strategy_named(name)
            recipe = recipe_named("best")
            drivers[name] = options.build(FINGER, recipe, None, RunOptions())
        return drivers[name]

    return build


@pytest.mark.parametrize("name", NEAR)
def test_it_comes_near_a_target_holds_still_without_one_and_plans_alike_twice(
    name, built
):
    target = FINGER.length * np.array([0.3, 0.0, 0.9])
    goals = [STILL.with_position(target)] * 40 + [STILL] * 3
    bends, states = drive_ideal(built(name), FINGER, goals)
    miss = np.linalg.norm(states[39, -1, :3] - target)
    assert miss < NEAR[name] * FINGER.length
    np.testing.assert_allclose(bends[40:], bends[39:-1], atol=1e-5)
    again, _ = drive_ideal(built(name), FINGER, goals)
    np.testing.assert_array_equal(bends, again)


@pytest.mark.parametrize("name", [MULTI_IK, SAMPLING, "apf", "pcc-one-step", "diff-ik"])
def test_the_tip_stays_outside_of_an_obstacle_around_its_target(name, built):
    target = FINGER.length * np.array([0.25, 0.0, 0.9])
    radius = 0.1 * FINGER.length
    goal = STILL.with_position(target).with_obstacles([target], [radius])
    _, states = drive_ideal(built(name), FINGER, [goal] * 20)
    gaps = np.linalg.norm(states[:, -1, :3] - target, axis=-1)
    assert gaps.min() > radius + FINGER.modules[-1].radius
    assert gaps[-1] < 2.0 * radius


@pytest.mark.parametrize(
    ("name", "within"),
    slow_after(1, [("biarc", 0.0115), ("diff-ik", 0.005), ("pcc-one-step", 0.01)]),
)
def test_the_tip_arrives_with_its_axis(name, within):
    twin = load_arm("twin_arm")
    lengths = np.full(3, 0.2, np.float32)
    bends = np.array([[0.3, 0.1], [0.2, -0.2], [-0.1, 0.4]], np.float32)
    target = np.asarray(states_from_bends(bends, lengths))[-1]
    goal = Goal.of(3).with_position(target[:3]).with_axis(target[3:])
    recipe = recipe_named("best")
    driver = strategy_named(name).build(twin, recipe, None, RunOptions("arm"))
    _, states = drive_ideal(driver, twin, [goal] * 40)
    np.testing.assert_allclose(states[-1, -1], target, atol=within)
