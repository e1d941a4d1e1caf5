"""Goal of a request, and errors of the tip."""

import numpy as np
import pytest

from s2c2a.arm import ArmSpec
from s2c2a.goals import Goal
from s2c2a.live.goals import RequestedDisturbances, goal_of, tip_errors
from s2c2a.live.request import Obstacle, Request, WeightFactors
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading


def test_the_drivers_obstacles_and_weights_join_the_tasks():
    task_goal = Goal.of(3).with_position([0.1, 0, 0.5])
    task_goal = task_goal.with_obstacles([[0.2, 0, 0.5]], [0.06])
    request = Request(
        obstacles=(Obstacle((0.0, 0.2, 0.5), 0.08),),
        weights=WeightFactors(position=2.0, obstacle=3.0),
    )
    goal = goal_of(request, 3, task_goal)
    np.testing.assert_allclose(goal.thresholds[:3], [0.06, 0.08, 0.0], rtol=1e-6)
    np.testing.assert_allclose(goal.obstacles[1], [0.0, 0.2, 0.5], rtol=1e-6)
    assert goal.position_weights[-1] == 2.0
    assert goal.obstacle_weight == 3.0


def test_a_drawn_shape_desires_every_end_and_the_tangents_of_the_curve():
    ends = ((0.0, 0.0, 0.2), (0.02, 0.0, 0.4), (0.1, 0.0, 0.57))
    goal = goal_of(Request(target=ends[-1], shape=ends[:-1]), 3, None)
    np.testing.assert_allclose(goal.positions, ends, rtol=1e-6)
    assert (goal.position_weights > 0).all()
    tangents = goal.axes[:, 0] / goal.axes[:, 2]
    assert (np.diff(tangents[1:]) > 0).all()
    assert goal_of(Request(shape=ends[:-1]), 3, None).has_target == False  # noqa: E712
    at_base = goal_of(Request(target=(0.0, 0.0, 0.0), shape=((0.0,) * 3,) * 2), 3, None)
    assert np.isfinite(at_base.axes).all()


def test_tip_errors_are_distances_to_the_target_and_the_nearest_threshold():
    goal = Goal.of(3).with_position([0.3, 0.0, 0.4])
    goal = goal.with_obstacles([[0.0, 0.0, 1.0], [5.0, 0.0, 0.0]], [0.1, 0.1])
    error, clearance = tip_errors(goal, np.array([0.0, 0.0, 0.4]))
    assert error == pytest.approx(0.3)
    assert clearance == pytest.approx(0.5)
    error, clearance = tip_errors(Goal.of(3), np.zeros(3))
    assert np.isnan(error)
    assert np.isinf(clearance)


@pytest.mark.parametrize("changes", [{"noise": 0.001}, {"coupling": 0.5}])
def test_disturbed_sensors_keep_the_fault_and_the_time_of_the_robot(twin, changes):
    disturbances = RequestedDisturbances(SimulatedRobot(twin))
    disturbances.apply(Request(**changes))
    cables = np.zeros((3, 3))
    reading = Reading(1.5, {"cables": cables}, "servo 3 overheated")
    disturbed = disturbances.corrupt(reading)
    assert (disturbed.time, disturbed.fault) == (1.5, "servo 3 overheated")


def test_columns_without_a_cable_stay_zero_under_noise(make_arm):
    described = make_arm(modules=2).model_dump()
    described["modules"][0]["cable_angles_deg"] = []
    disturbances = RequestedDisturbances(
        SimulatedRobot(ArmSpec.model_validate(described))
    )
    disturbances.apply(Request(noise=0.01))
    reading = disturbances.corrupt(Reading(0.0, {"cables": np.zeros((2, 3))}))
    assert (reading.sensors["cables"][0] == 0.0).all()
    assert (reading.sensors["cables"][1] != 0.0).all()
