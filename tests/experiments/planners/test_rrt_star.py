"""Random trees in bends around obstacles."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.goals import Goal
from s2c2a.kinematics import states_from_bends
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a_experiments.planners.rrt_star import RRT, RRTStar, Tree, jumps

from ideal_arm import drive_ideal

OPTIONS = RRTStar(neighbors=4, waiting=3)
TARGET = np.array([0.25, 0.0, 0.9])  # of the arm's length, in the plane of the finger


def driver_for(arm, options=OPTIONS):
    return options.build(arm, recipe_named("paper"), None, RunOptions())


@pytest.fixture(scope="module")
def finger():
    return load_arm("planar_finger")


@pytest.fixture(scope="module")
def driver(finger):
    return driver_for(finger)


def goals_past(arm, obstacle, radius):
    """From one side of the tip to the other, where an obstacle appears between them."""
    sides = [arm.length * np.array([x, 0.0, 0.85]) for x in (-0.35, 0.35)]
    first, last = [Goal.of(arm.module_count).with_position(side) for side in sides]
    return first, last.with_obstacles([obstacle], [radius])


@pytest.mark.slow
def test_it_leads_around_an_obstacle_that_blocks_the_straight_way():
    arm = load_arm("twin_arm")
    driver = driver_for(arm, RRT(samples=16))
    obstacle, radius = arm.length * np.array([0.0, 0.0, 0.97]), 0.13 * arm.length
    first, last = goals_past(arm, obstacle, radius)
    bends, states = drive_ideal(driver, arm, [first] * 20 + [last] * 60)
    gaps = np.linalg.norm(states[20:, -1, :3] - obstacle, axis=-1)
    straight = bends[19] + np.linspace(0, 1, 50)[:, None, None] * (
        bends[-1] - bends[19]
    )
    lengths = ArmGeometry.of(arm).lengths
    ways = np.array([states_from_bends(bend, lengths) for bend in straight])
    straight_gaps = np.linalg.norm(ways[:, -1, :3] - obstacle, axis=-1)
    np.testing.assert_allclose(states[-1, -1, :3], last.positions[-1], atol=1e-3)
    assert gaps.min() > radius + arm.modules[-1].radius
    assert straight_gaps.min() < radius


def test_a_tree_plans_alike_twice(driver, finger):
    obstacle, radius = finger.length * np.array([0, 0, 0.97]), 0.13 * finger.length
    first, last = goals_past(finger, obstacle, radius)
    once, _ = drive_ideal(driver, finger, [first] * 10 + [last] * 5)
    again, _ = drive_ideal(driver, finger, [first] * 10 + [last] * 5)
    np.testing.assert_array_equal(once, again)


def test_a_tree_gives_nodes_the_parents_of_the_shortest_ways():
    """Root at 0; 2 beside it at a detour of 3 [rad]; then 1 shortens the way to 2 alone."""
    tree = Tree(shape_at(0.0))
    tree.connect(shape_at(3.0), -1, np.array([0]), np.array([True]))
    tree.connect(shape_at(2.0), -1, np.array([1, 0]), np.array([True, False]))
    tree.connect(shape_at(1.0), 5, np.array([0, 2, 1]), np.array([True, True, False]))
    tree.measure()
    np.testing.assert_allclose(tree.totals, [0.0, 3.0, 2.0, 1.0])
    np.testing.assert_array_equal(tree.way_to(2), [shape_at(1.0), shape_at(2.0)])
    np.testing.assert_array_equal(tree.ends, [-1, -1, -1, 5])
    tree.forget_ends(np.array([5]))
    np.testing.assert_array_equal(tree.ends, [-1, -1, -1, -1])


def test_a_tree_takes_no_node_without_a_free_edge():
    tree = Tree(shape_at(0.0))
    tree.connect(shape_at(1.0), -1, np.array([0]), np.array([False]))
    assert len(tree.nodes) == 1


def shape_at(bend):
    return np.array([[bend, 0.0]])


def test_a_target_jumps_by_its_distance_in_arm_lengths():
    before = Goal.of(2).with_position([0.0, 0.0, 1.0])
    assert not jumps(before, Goal.of(2).with_position([0.0, 0.05, 1.0]), 1.0)
    assert jumps(before, Goal.of(2).with_position([0.0, 0.05, 1.0]), 0.1)
    assert jumps(before, before.with_axis([0.0, 0.0, 1.0]), 1.0)
