"""Backlash a cable, homing errors, viscous friction, drift, and motor currents."""

import numpy as np
import pytest

from held_arm import settled
from s2c2a.arm import ArmGeometry, Cable, Mismatch, Motor
from s2c2a.errors import S2C2AError
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.robots.simulation.transmission import CableTransmission

WEIGHTLESS = {"gravity_direction": (0.0, 0.0, 0.0), "modules": 1}
NOTHING, STRAIGHT = np.zeros((1, 3)), np.zeros(1)


def test_every_cable_has_its_own_backlash(make_arm):
    losing = CableTransmission(
        make_arm(modules=1, module={"cable": Cable(backlash=(0.0, 1e-3, 2e-3))}),
        NOTHING,
    )
    felt = losing.transmit(np.full((1, 1, 3), 5e-3), np.array([0.1]), NOTHING, STRAIGHT)
    np.testing.assert_allclose(felt[0, 0], [5e-3, 4e-3, 3e-3])


def test_homing_errors_bend_the_arm_at_rest_and_are_new_at_every_opening(make_arm):
    arm = make_arm(motor=Motor(homing_error=1e-3), **WEIGHTLESS)
    robot, again = (SimulatedRobot(arm, seed=5) for _ in range(2))
    first, second = (robot.open()["configurations"] for _ in range(2))
    assert np.abs(first - second).max() > 1e-3
    for opened in (first, second):
        np.testing.assert_array_equal(again.open()["configurations"], opened)


def test_a_module_lags_behind_cables_that_move_by_their_viscous_friction(
    make_arm, fidelity
):
    """Two dampers c r^2 beside two springs k r^2, and the module's EI / L.

    So the module lags by a time tau = 2 c r^2 / (2 k r^2 + EI / L) more than without
    friction.
    """
    friction, stiffness, speed, lengths = 100.0, 4000.0, 0.01, []
    for viscous in (0.0, friction):
        module = {
            "cable": Cable(stiffness=stiffness, viscous_friction=viscous),
            "pretension": 20.0,
        }
        motor = Motor(speed_limit=speed)
        arm = make_arm(cables=4, motor=motor, module=module, **WEIGHTLESS)
        robot = SimulatedRobot(arm, fidelity)
        robot.open()
        for _ in range(15):
            before = robot.data.ten_length[0]
            robot.step([[-0.02, 0.0, 0.02, 0.0]])
        lengths.append(robot.data.ten_length[0])
    springs, moved = 2 * stiffness * 0.027**2, (before - lengths[-1]) / 0.1
    assert moved == pytest.approx(speed * springs / (springs + 0.16 / 0.2), rel=0.03)
    behind = moved * 2 * friction * 0.027**2 / (springs + 0.16 / 0.2)
    assert lengths[1] - lengths[0] == pytest.approx(behind, rel=0.05)


def test_viscous_friction_reduces_the_tension_of_a_moving_tension_arm(
    make_arm, fidelity
):
    """However slow it makes the module, it bends as far in the end."""
    ends, halfway = [], []
    for viscous in (0.0, 300.0):
        module = {"tension_range": 20.0, "cable": Cable(viscous_friction=viscous)}
        arm = make_arm(actuation="tension", module=module, **WEIGHTLESS)
        for bent, seconds in ((halfway, 0.2), (ends, 8.0)):
            robot = settled(arm, [[10.0, 0.0, 0.0]], fidelity, seconds)
            bent.append(robot.configurations()[0, 0])
    assert ends[0] == pytest.approx(ends[1], rel=1e-3)
    assert halfway[1] < 0.8 * halfway[0]


def test_a_cable_without_tension_resists_extension_and_does_not_push(
    make_arm, fidelity
):
    module = {"tension_range": 20.0, "cable": Cable(viscous_friction=300.0)}
    arm = make_arm(actuation="tension", module=module, **WEIGHTLESS)
    robot = settled(arm, [[10.0, 0.0, 0.0]], fidelity, seconds=0.1)
    out = robot.data.ten_velocity
    assert out[1:].min() > 1e-3
    np.testing.assert_allclose(robot.tensions()[0, 1:], 300.0 * out[1:], rtol=1e-6)
    robot.step([[0.0, 0.0, 0.0]])
    back = robot.data.ten_velocity[1:]
    assert back.max() < -1e-3
    np.testing.assert_allclose(robot.tensions()[0, 1:], 0.0, atol=1e-9)


def test_an_aged_arm_loses_the_drift_share_of_motor_motion(make_arm, fidelity):
    arm = make_arm(
        module={"mismatch": Mismatch(drift=0.1), "pretension": 5.0}, **WEIGHTLESS
    )
    action = ArmGeometry.of(arm).actions_at(np.array([[0.5, 0.0]]))
    young, half, old = (
        settled(arm, action, fidelity, aged=aged).configurations()[0, 0]
        for aged in (0, 0.5, 1)
    )
    assert np.arcsin(old) / np.arcsin(young) == pytest.approx(0.9, abs=2e-3)
    assert np.arcsin(half) / np.arcsin(young) == pytest.approx(0.95, abs=2e-3)


def test_drift_leaves_the_tensions_at_rest_alone(make_arm):
    module = {
        "tension_range": 20.0,
        "pretension": 10.0,
        "mismatch": Mismatch(drift=0.2),
    }
    arm = make_arm(modules=1, actuation="tension", module=module)
    aged = CableTransmission(arm, np.full((1, 3), 10.0), aged=1.0)
    felt = aged.transmit(
        np.array([[[10.0, 20.0, 0.0]]]), np.array([0.1]), NOTHING, STRAIGHT
    )
    np.testing.assert_allclose(felt[0, 0], [10.0, 18.0, 2.0])


@pytest.mark.parametrize("aged", [-0.1, 1.1])
def test_an_invalid_age_is_rejected(make_arm, aged):
    with pytest.raises(S2C2AError, match="aged"):
        SimulatedRobot(make_arm(), aged=aged)


def test_tensions_need_current_noise_in_the_arm_file(make_arm):
    assert "tensions" not in SimulatedRobot(make_arm()).sensors
    robot = SimulatedRobot(make_arm(motor=Motor(current_noise=0.1)))
    assert robot.open()["tensions"].shape == robot.sensors["tensions"].shape == (3, 3)


def test_currents_add_gear_friction_while_winding_in(make_arm):
    module = {
        "pretension": 8.0,
        "cable": Cable(stiffness=3000.0, friction=0.1, friction_angle_deg=180.0),
    }
    arm = make_arm(
        motor=Motor(current_noise=0.0, current_friction=1.5),
        module=module,
        **WEIGHTLESS,
    )
    robot = settled(arm, [[-0.002, 0.001, 0.001]])
    at_motors = robot.tensions()[0] * np.exp(0.1 * np.pi * np.array([1, -1, -1]))
    np.testing.assert_allclose(
        robot.read()["tensions"][0], at_motors + 1.5 * np.array([1, -1, -1]), rtol=1e-6
    )


def test_current_noise_has_the_stated_size(make_arm):
    robot = SimulatedRobot(make_arm(motor=Motor(current_noise=0.4)), seed=3)
    robot.open()
    said = np.array([robot.read()["tensions"] for _ in range(300)])
    assert said.std(axis=0).mean() == pytest.approx(0.4, rel=0.05)


def test_currents_of_a_tension_arm_measure_its_motors(make_arm):
    arm = make_arm(
        actuation="tension",
        motor=Motor(current_noise=0.0, current_friction=0.5),
        module={"tension_range": 20.0},
        **WEIGHTLESS,
    )
    robot = settled(arm, [[10.0, 4.0, 0.0]])
    np.testing.assert_allclose(robot.read()["tensions"], [[10.5, 4.5, 0.0]])
