"""The arm lies along a drawn curve."""

from functools import cache

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.goals import Goal
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a_experiments.planners.drawn_curve import DrawnCurve

from ideal_arm import drive_ideal

STEPS = 40


@cache
def built(name: str):
    run = RunOptions()
    return DrawnCurve().build(load_arm(name), recipe_named("paper"), None, run)


def driven(arm, goals) -> tuple[np.ndarray, np.ndarray]:
    return drive_ideal(built(arm.name), arm, goals)


@pytest.fixture(scope="module")
def twin():
    return load_arm("twin_arm")


def test_without_a_target_it_holds_still_and_every_run_is_the_same(twin):
    goals = [Goal.of(3).with_position([0.2, 0.1, 0.5])] * 5 + [Goal.of(3)] * 5
    bends, _ = driven(twin, goals)
    np.testing.assert_allclose(bends[5:], bends[4:5].repeat(5, axis=0), atol=1e-5)
    np.testing.assert_array_equal(bends, driven(twin, goals)[0])


@pytest.mark.parametrize(
    "name", ["planar_finger", pytest.param("pneumatic_arm", marks=pytest.mark.slow)]
)
def test_other_arms_arrive(name):
    arm = load_arm(name)
    target = np.array([0.3, 0.0, 0.9]) * arm.length
    goal = Goal.of(arm.module_count).with_position(target)
    _, states = driven(arm, [goal] * STEPS)
    assert np.linalg.norm(states[-1, -1, :3] - target) < 0.01 * arm.length
