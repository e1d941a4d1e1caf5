"""Targets out of reach are moved to the nearest within; others stay."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning.reach import Reachability
from s2c2a.tasks import Task
from s2c2a.tasks.lines import goal_at
from s2c2a.tasks.projection import projected

ARM = load_arm("twin_arm")
REACH = Reachability(ARM, PCCForwardModel.of(ARM))


@pytest.mark.slow
def test_only_targets_out_of_reach_are_moved():
    near, far = goal_at(ARM, (0.2, 0.0, 0.5)), goal_at(ARM, (0.9, 0.0, 0.3))
    free = near._replace(position_weights=np.zeros(3, np.float32))
    found = projected(Task("path", (near, far, free)), ARM.length, REACH)
    np.testing.assert_array_equal(found.is_moved, [False, True, False])
    assert found.task.goals[0] is near
    assert found.task.goals[2] is free
    moved = found.task.goals[1].positions[-1]
    missed = np.linalg.norm(moved - far.positions[-1])
    np.testing.assert_allclose(found.reached.position_errors[1], missed, rtol=1e-4)
    again = projected(found.task, ARM.length, REACH)
    assert not again.is_moved.any()


def test_equal_targets_are_searched_once():
    goals = [goal_at(ARM, (0.1 * k, 0.0, 0.5)) for k in (2, 9, 2, 9, 9)]
    searched = []

    class Counted:
        def nearest(self, goals):
            searched.append(len(goals.positions))
            return REACH.nearest(goals)

    found = projected(Task("path", tuple(goals)), ARM.length, Counted())
    assert searched == [2]
    np.testing.assert_array_equal(found.is_moved, [False, True, False, True, True])
