"""Samples of the redundant bends, whose other modules are solved."""

import numpy as np

from s2c2a.goals import Goal
from s2c2a_experiments.planners.inverse_sampling import moved_modules


def test_an_axis_and_inner_ends_leave_less_to_samples():
    goal = Goal.of(4).with_position([0.0, 0.0, 1.0])
    np.testing.assert_array_equal(moved_modules(goal), [0, 0, 1, 1])
    np.testing.assert_array_equal(
        moved_modules(goal.with_axis([0, 0, 1])), [0, 1, 1, 1]
    )
    inner = goal.with_position([0.0, 0.0, 0.5], module=1)
    np.testing.assert_array_equal(moved_modules(inner), [1, 1, 1, 1])
