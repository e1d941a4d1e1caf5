"""Fuzzy rules, and the arm that they lead."""

from functools import cache

import numpy as np

from s2c2a.goals import Goal
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a_experiments.planners.fuzzy import Fuzzy, memberships, sugeno

from ideal_arm import drive_ideal

TARGET = [0.2, -0.1, 0.54]


@cache
def built(arm):
    return Fuzzy().build(arm, recipe_named("paper"), None, RunOptions())


def driven(arm, goals) -> tuple[np.ndarray, np.ndarray]:
    return drive_ideal(built(arm), arm, goals)


def test_memberships_sum_to_one_and_rules_grow_with_error_and_change():
    values = np.linspace(-2.0, 2.0, 41)
    np.testing.assert_allclose(memberships(values).sum(axis=-1), 1.0)
    np.testing.assert_allclose(sugeno(values, 0.0 * values), np.clip(values, -1, 1))
    assert (np.diff(sugeno(0.0 * values, values)) >= 0.0).all()


def test_the_tip_arrives_and_stays_while_its_axis_turns(twin):
    there = Goal.of(3).with_position(TARGET)
    _, before = driven(twin, [there] * 100)
    assert np.linalg.norm(before[-1, -1, :3] - TARGET) < 0.02
    axis = before[-1, -1, 3:] + [0.0, 0.3, 0.0]
    turned = there.with_axis(axis / np.linalg.norm(axis))
    _, after = driven(twin, [there] * 100 + [turned] * 100)
    misses = np.linalg.norm(after[100:, -1, :3] - TARGET, axis=-1)
    assert misses.max() < 0.03
    assert after[-1, -1, 3:] @ turned.axes[-1] > np.cos(np.deg2rad(4.0))


def test_it_follows_a_moving_target_without_staying_behind(twin):
    steps = np.linspace(0.0, 1.0, 60)[:, None]
    targets = np.array([0.0, 0.0, 0.6]) + steps * [0.2, -0.1, -0.06]
    goals = [Goal.of(3).with_position(target) for target in targets]
    _, states = driven(twin, goals)
    assert np.linalg.norm(states[:, -1, :3] - targets, axis=-1).max() < 0.03
