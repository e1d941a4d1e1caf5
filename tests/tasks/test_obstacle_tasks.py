"""Reach and flee: targets and obstacles by hand from docs/results/protocol.md."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.planning import Goal
from s2c2a.tasks import Task, load_task

TWIN = load_arm("twin_arm")
OBSTACLES = {
    "reach-0": [],
    "reach-1": [[0.16, 0.02, 0.55, 0.06]],
    "reach-2": [[0.16, 0.02, 0.55, 0.06], [0.21, -0.03, 0.52, 0.04]],
    "risk-a": [[0.16, -0.07, 0.56, 0.11], [0.16, 0.07, 0.56, 0.03]],
    "risk-b": [[0.16, -0.07, 0.56, 0.11], [0.16, 0.07, 0.56, 0.11]],
    "risk-c": [[0.16, -0.07, 0.56, 0.03], [0.16, 0.07, 0.56, 0.11]],
}


def tips(task):
    return task.desired_positions()[:, -1]


def test_the_reference_runs_straight_from_rest_at_five_centimeters_a_second():
    """0.3195 m are 64 steps of 5 mm, nearly."""
    path = np.concatenate([[[0, 0, 0.6]], tips(load_task("reach-0", TWIN))])
    moves = np.diff(path, axis=0)[:64]
    expected = np.tile(np.array([0.30, 0, -0.11]) / 64, (64, 1))
    np.testing.assert_allclose(moves, expected, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(moves, axis=-1), 0.005, rtol=0.01)


@pytest.mark.parametrize(("name", "obstacles"), OBSTACLES.items())
def test_obstacles_stand_still_beside_the_same_reference(name, obstacles):
    task = load_task(name, TWIN)
    np.testing.assert_array_equal(tips(task), tips(load_task("reach-0", TWIN)))
    expected = np.tile(np.reshape(obstacles, (-1, 4)), (240, 1, 1))
    np.testing.assert_allclose(task.obstacles()[..., :4], expected, atol=1e-7)


def test_the_obstacle_waits_approaches_waits_and_passes():
    steps = np.array([1, 10, 11, 27, 44, 64, 65, 94, 114])
    x = [0.25, 0.25, 0.245, 0.165, 0.08, 0.08, 0.075, -0.07, -0.07]
    (found,) = load_task("flee", TWIN).obstacles()[steps - 1, :, :4].swapaxes(0, 1)
    np.testing.assert_allclose(found[:, 0], x, atol=1e-6)
    np.testing.assert_allclose(found[:, 1:], [[0.02, 0.58, 0.10]] * 9, atol=1e-6)


def test_an_obstacle_that_comes_later_is_listed_with_no_threshold_until_it_is_there():
    rest = Goal.of(3)
    task = Task("later", (rest, rest.with_obstacles([[0.1, 0.2, 0.3]], [0.05])))
    expected = [[[0, 0, 0, 0]], [[0.1, 0.2, 0.3, 0.05]]]
    np.testing.assert_allclose(task.obstacles()[..., :4], expected, atol=1e-7)
