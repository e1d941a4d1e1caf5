"""Arm and motors behind emulated servos."""

import numpy as np
import pytest

from s2c2a.arm import Motor, load_arm
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.plant import DRIVING_FRICTION, SLACK, Plant, approach
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.robots.simulation.transmission import compute_motor_path

ARM = load_arm("twin_arm")
BEND = np.array([0.004, -0.008, 0.004, -0.006, 0.003, 0.003, 0.002, 0.002, -0.004])
SPEED = 0.1  # m/s
STRONG = 100.0  # N


@pytest.fixture
def plant():
    return Plant(ARM, homed=True)


def power(plant, goal, tension=STRONG):
    plant.targets.torque[:] = True
    plant.targets.goal[:] = goal
    plant.targets.speed[:] = SPEED
    plant.targets.tension[:] = tension


def advance(plant, seconds):
    for _ in range(round(seconds / plant.chunk)):
        plant.advance()


@pytest.mark.parametrize("speed", [0.02, 10.0])
def test_motors_approach_goals_as_those_of_the_simulated_robot(speed):
    position = np.array([0.0, 0.001, -0.004])
    goal = np.array([0.002, 0.001, 0.01])
    motor = Motor(time_constant=0.05, speed_limit=min(speed, 5.0))
    path = compute_motor_path(position, goal, np.array([0.03]), motor)
    speeds = np.full(3, min(speed, 5.0))
    np.testing.assert_allclose(approach(position, goal, 0.03, 0.05, speeds), path[0])


def test_the_arm_moves_as_in_direct_simulation(plant):
    robot = SimulatedRobot(ARM)
    robot.open()
    power(plant, BEND)
    plant.targets.speed[:] = 10.0
    for _ in range(10):
        robot.step(BEND.reshape(3, 3))
    advance(plant, 1.0)
    difference = plant.states() - robot.states()
    assert np.abs(difference[:, :3]).max() < 0.001
    assert np.abs(robot.states()[-1, :2]).max() > 0.05


def test_cables_have_slack_at_power_up_and_none_when_homed(plant):
    slack = Plant(ARM, seed=3).positions
    assert ((slack > SLACK[0]) & (slack < SLACK[1])).all()
    assert not plant.positions.any()
    np.testing.assert_array_equal(slack, Plant(ARM, seed=3).positions)


def test_winding_stops_at_the_tension_limit(plant):
    power(plant, -0.02, tension=3.0)
    advance(plant, 1.0)
    # Friction of the tubes adds to the tension of the cable as a spring.
    np.testing.assert_allclose(plant.pulls(), 3.0 - DRIVING_FRICTION, rtol=0.05)
    assert (plant.positions > -0.02).all()


def test_a_motor_yields_above_its_tension_limit(plant):
    power(plant, -0.002)
    advance(plant, 0.5)
    held = plant.pulls()
    power(plant, -0.002, tension=1.0)
    advance(plant, 0.5)
    assert held.min() > 2.0
    assert plant.pulls().max() < 1.1 + DRIVING_FRICTION


def test_motors_without_power_stay_under_little_tension(plant):
    power(plant, BEND / 8)
    advance(plant, 0.5)
    plant.targets.torque[:] = False
    before = plant.positions
    advance(plant, 0.5)
    assert plant.pulls().max() < 3.0
    np.testing.assert_allclose(plant.positions, before, atol=1e-4)


def test_motors_without_power_are_turned_by_a_tight_cable(plant):
    power(plant, -0.003)
    advance(plant, 0.5)
    tight = plant.pulls().max()
    plant.targets.torque[:] = False
    advance(plant, 0.5)
    assert tight > 5.0
    assert plant.pulls().max() < tight / 2
    assert (plant.positions > -0.003).all()


def test_a_torn_cable_carries_nothing(plant):
    plant.snapped[1] = True
    power(plant, -0.003)
    advance(plant, 0.5)
    assert plant.tensions[1] == 0.0
    assert plant.positions[1] == pytest.approx(-0.003, abs=1e-4)
    # The two other cables of the module bend it away.
    assert np.abs(plant.states()[0, :2]).max() > 0.002


def test_a_jammed_motor_stays_and_pulls_with_all_its_force(plant):
    plant.stalled[2] = True
    power(plant, -0.003, tension=20.0)
    advance(plant, 0.3)
    assert plant.positions[2] == 0.0
    assert plant.tensions[2] == 20.0


def test_poses_are_those_of_the_module_ends(plant):
    power(plant, BEND)
    advance(plant, 0.5)
    poses = plant.poses()
    assert list(poses) == ["base", "end-1", "end-2", "end-3"]
    np.testing.assert_array_equal(poses["base"].rotation, [0, 0, 0, 1])
    x, y, z, w = poses["end-3"].rotation
    axis = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    state = plant.states()[-1]
    np.testing.assert_allclose(np.r_[poses["end-3"].position, axis], state, atol=1e-9)


def test_a_tension_arm_has_no_servos():
    with pytest.raises(S2C2AError, match="tension actuation"):
        Plant(load_arm("simulated_arm"))
