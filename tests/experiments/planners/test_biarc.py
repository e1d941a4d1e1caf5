"""Bi-arcs end at their targets, along their axes."""

from functools import cache

import jax
import numpy as np

from s2c2a.goals import Goal
from s2c2a.kinematics import states_from_bends
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a_experiments.planners.biarc import BiArc

from ideal_arm import drive_ideal

STEPS = 40


@cache
def built(arm):
    return BiArc().build(arm, recipe_named("paper"), None, RunOptions())


def test_it_arrives_along_the_axis_of_a_shape_of_the_arm(twin):
    bends = np.array([[0.5, 0.1], [0.1, 0.3], [-0.3, 0.4]], np.float32)
    lengths = np.array([0.2, 0.2, 0.2], np.float32)
    tip = np.asarray(jax.jit(states_from_bends)(bends, lengths))[-1]
    goal = Goal.of(3).with_position(tip[:3]).with_axis(tip[3:])
    _, states = drive_ideal(built(twin), twin, [goal] * STEPS)
    assert np.linalg.norm(states[-1, -1, :3] - tip[:3]) < 0.02
    assert states[-1, -1, 3:] @ tip[3:] > np.cos(np.deg2rad(5.0))
