"""Motors against brute-force integration, encoders against their ticks."""

import numpy as np
import pytest

from s2c2a.arm import Motor
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.robots.simulation.transmission import compute_motor_path, read_encoders

MOTORS = {
    "neither": Motor(),
    "lag": Motor(time_constant=0.05),
    "speed limit": Motor(speed_limit=0.2),
    "both": Motor(time_constant=0.05, speed_limit=0.2),
}
STARTS = np.array([[0.0, 0.03, -0.02, 0.004, 0.0, 0.0101]])
COMMANDS = np.array([[0.02, -0.01, -0.02, 0.0, 1e-5, 0.0]])
TIMES = 0.005 * np.arange(1, 21)


def by_euler(motor: Motor, step: float = 1e-5) -> np.ndarray:
    """Positions at TIMES: the rate is the gap over the lag, at most the speed limit."""
    position, positions = STARTS.copy(), []
    # without lag the gap closes within one small step
    slowness = max(motor.time_constant, step)
    limit = motor.speed_limit or np.inf
    for count in range(1, round(TIMES[-1] / step) + 1):
        position = position + step * np.clip(
            (COMMANDS - position) / slowness, -limit, limit
        )
        if count % 500 == 0:
            positions.append(position)
    return np.array(positions)


@pytest.mark.parametrize("motor", MOTORS.values(), ids=MOTORS)
def test_motors_agree_with_brute_force_integration(motor):
    np.testing.assert_allclose(
        compute_motor_path(STARTS, COMMANDS, TIMES, motor), by_euler(motor), atol=5e-6
    )


@pytest.mark.parametrize("motor", MOTORS.values(), ids=MOTORS)
def test_a_path_in_two_parts_has_the_same_end(motor):
    whole = compute_motor_path(STARTS, COMMANDS, TIMES, motor)
    halfway = whole[9]
    np.testing.assert_allclose(
        compute_motor_path(halfway, COMMANDS, TIMES[:10], motor), whole[10:], atol=1e-15
    )


def test_encoders_count_whole_ticks():
    motor = Motor(pulley_radius=0.01, ticks_per_turn=4096, noise_ticks=3.0)
    tick = 2 * np.pi * 0.01 / 4096
    noise = np.random.default_rng(0).normal(scale=3.0, size=500)
    ticks = read_encoders(np.linspace(-0.02, 0.02, 500), motor, noise) / tick
    np.testing.assert_allclose(ticks, np.round(ticks), atol=1e-6)
    assert len(np.unique(np.round(ticks))) > 100


def test_without_noise_the_error_is_at_most_half_a_tick():
    motor, positions = Motor(noise_ticks=0.0), np.linspace(-0.02, 0.02, 999)
    tick = 2 * np.pi * motor.pulley_radius / motor.ticks_per_turn
    errors = read_encoders(positions, motor, np.zeros(999)) - positions
    assert 0.4 * tick < np.max(np.abs(errors)) <= 0.5 * tick * (1 + 1e-6)


def test_encoder_noise_has_the_stated_size(make_arm):
    motor = Motor(noise_ticks=20.0)
    tick = 2 * np.pi * motor.pulley_radius / motor.ticks_per_turn
    with SimulatedRobot(make_arm(modules=6, motor=motor)) as robot:
        measured = [robot.measure_cables() for _ in range(1000)]
    readings = (np.array(measured) - robot.motors) / tick
    assert readings.std() == pytest.approx(20.0, rel=0.03)
    assert readings.mean() == pytest.approx(0.0, abs=0.6)


def test_tension_sensors_have_their_own_noise(make_arm):
    noisy = make_arm(
        modules=6,
        cables=8,
        actuation="tension",
        module={"tension_range": 5.0, "pretension": 9.0},
        motor={"noise_tension": 0.5},
    )
    with SimulatedRobot(noisy) as robot:
        readings = np.array([robot.read()["cables"] for _ in range(200)])
    assert readings.std() == pytest.approx(0.5, rel=0.05)
    assert readings.mean() == pytest.approx(9.0, abs=0.02)
