"""Bi-arcs end at their targets, along their axes."""

from functools import cache

import jax
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.goals import Goal
from s2c2a.kinematics import states_from_bends
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a_experiments.planners.biarc import BiArc

from ideal_arm import drive_ideal

STEPS = 40


@cache
def built(arm):
    return BiArc().build(arm, recipe_named("paper"), None, RunOptions())


@pytest.fixture(scope="module")
def twin():
    return load_arm("twin_arm")


@pytest.mark.slow
def test_the_tip_arrives_exactly(twin):
    goal = Goal.of(3).with_position([0.2, -0.1, 0.5])
    _, states = drive_ideal(built(twin), twin, [goal] * STEPS)
    assert np.linalg.norm(states[-1, -1, :3] - [0.2, -0.1, 0.5]) < 1e-3


def test_it_arrives_along_the_axis_of_a_shape_of_the_arm(twin):
    bends = np.array([[0.5, 0.1], [0.1, 0.3], [-0.3, 0.4]], np.float32)
    lengths = np.array([0.2, 0.2, 0.2], np.float32)
    tip = np.asarray(jax.jit(states_from_bends)(bends, lengths))[-1]
    goal = Goal.of(3).with_position(tip[:3]).with_axis(tip[3:])
    _, states = drive_ideal(built(twin), twin, [goal] * STEPS)
    assert np.linalg.norm(states[-1, -1, :3] - tip[:3]) < 0.02
    assert states[-1, -1, 3:] @ tip[3:] > np.cos(np.deg2rad(5.0))


def test_without_a_target_it_holds_still_and_every_run_is_the_same(twin):
    goals = [Goal.of(3).with_position([0.2, 0.1, 0.5])] * 5 + [Goal.of(3)] * 5
    bends, _ = drive_ideal(built(twin), twin, goals)
    np.testing.assert_allclose(bends[5:], bends[4:5].repeat(5, axis=0), atol=1e-5)
    np.testing.assert_array_equal(bends, drive_ideal(built(twin), twin, goals)[0])


@pytest.mark.parametrize(
    "name", ["planar_finger", pytest.param("pneumatic_arm", marks=pytest.mark.slow)]
)
def test_other_arms_come_nearer(name):
    arm = load_arm(name)
    target = np.array([0.3, 0.0, 0.9]) * arm.length
    goal = Goal.of(arm.module_count).with_position(target)
    _, states = drive_ideal(built(arm), arm, [goal] * STEPS)
    assert np.linalg.norm(states[-1, -1, :3] - target) < 0.01 * arm.length
