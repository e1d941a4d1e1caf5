"""Following error: readings must follow the commands; honest motors pass."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.measurements.following import MARGIN, MAX_LAG, SUDDEN, FollowingMonitor
from s2c2a.robots.simulation.transmission import compute_motor_path
from s2c2a.spaces import Reading

STEPS = 120
HOLD = slice(25, 55)


def commands_of(arm):
    """Bends of a turning direction, up to the full bend and back."""
    moments = np.arange(STEPS) * arm.control_period
    share = np.sin(0.6 * moments)[:, None, None]
    directions = np.stack([np.cos(0.8 * moments), np.sin(0.8 * moments)], axis=-1)
    shares = np.repeat(share * directions[:, None], arm.module_count, axis=1)
    geometry = ArmGeometry.of(arm)
    actions = geometry.actions_at(shares)
    return np.clip(actions, geometry.action_low, geometry.action_high)


def faults_of(arm, readings, commands):
    """Faults of a reading after each command."""
    monitor = FollowingMonitor(arm)
    faults = []
    for step, (cables, command) in enumerate(zip(readings, commands, strict=True)):
        monitor.sent(command)
        faults.append(monitor.find_fault(Reading(float(step), {"cables": cables})))
    return faults


def with_motor(arm, **values):
    """The arm with other values of its motors."""
    return arm.model_copy(update={"motor": arm.motor.model_copy(update=values)})


def lagging(commands, arm, **motor):
    """Readings of motors that follow the commands with their lag and speed limit."""
    position = commands[0]
    readings = []
    period = np.array([arm.control_period])
    for command in commands:
        values = with_motor(arm, **motor).motor
        position = compute_motor_path(position, command, period, values)[-1]
        readings.append(position)
    return np.array(readings)


@pytest.fixture(params=["twin", "simulated"])
def arm(request):
    return request.getfixturevalue(request.param)


def test_cables_that_reach_their_commands_and_cables_with_a_lag_pass(arm):
    commands = commands_of(arm)
    steps = round(MAX_LAG * arm.control_rate)
    late = np.concatenate([np.repeat(commands[:1], steps, axis=0), commands[:-steps]])
    for readings in (commands, late, lagging(commands, arm, time_constant=0.3)):
        assert not any(faults_of(arm, readings, commands))


def test_motors_at_their_speed_limit_pass(arm):
    reach = np.abs(ArmGeometry.of(arm).action_scale).max()
    slow = with_motor(arm, speed_limit=0.1 * reach)
    commands = commands_of(arm)
    readings = lagging(commands, slow)
    assert np.abs(readings - commands).max() > 2.0 * MARGIN * reach
    assert not any(faults_of(slow, readings, commands))


WRONG = {
    "gain 4": lambda away: 4.0 * away,
    "wrong sign": lambda away: -away,
    "motors that do not move": lambda away: 0.0 * away,
}


@pytest.mark.parametrize("name", WRONG)
def test_cables_that_contradict_their_commands_are_a_fault(arm, name):
    geometry = ArmGeometry.of(arm)
    commands = commands_of(arm)
    readings = WRONG[name](commands - geometry.action_neutral) + geometry.action_neutral
    faults = [fault for fault in faults_of(arm, readings, commands) if fault]
    assert "the cables do not follow the commands: module 1, cable" in faults[0]


def test_the_fault_names_the_module_and_the_cable(twin):
    commands = commands_of(twin)
    readings = commands.copy()
    readings[:, 1, 2] += 0.5 * ArmGeometry.of(twin).action_scale[1]
    fault = faults_of(twin, readings, commands)[-1]
    assert "module 2, cable 3;" in fault


@pytest.mark.parametrize("gain", [0.8, 1.2])
def test_a_gain_that_is_wrong_by_a_fifth_passes(arm, gain):
    commands = commands_of(arm)
    rest = ArmGeometry.of(arm).action_neutral
    readings = rest + gain * (lagging(commands, arm, time_constant=0.1) - rest)
    assert not any(faults_of(arm, readings, commands))


def commands_with_a_hold(arm):
    """Commands that stand still while readings are refused, as those of the loop."""
    commands = commands_of(arm)
    commands[HOLD] = commands[HOLD.start]
    return commands


@pytest.mark.parametrize("count", [1, 5, 20])
@pytest.mark.parametrize("cables", ["one", "all"])
def test_readings_that_leave_at_once_are_refused_until_they_return(arm, cables, count):
    commands = commands_with_a_hold(arm)
    readings = commands.copy()
    which = (0, 0) if cables == "one" else (slice(None), slice(None))
    begin = HOLD.start + round(MAX_LAG * arm.control_rate) + 1
    away = 1.2 * SUDDEN * np.abs(ArmGeometry.of(arm).action_scale).max()
    readings[(slice(begin, begin + count), *which)] += away
    faults = faults_of(arm, readings, commands)
    assert all(faults[begin : begin + count])
    assert not any(faults[:begin] + faults[begin + count :])


@pytest.mark.parametrize("name", WRONG)
def test_readings_that_contradict_their_commands_stay_refused(arm, name):
    """The wrong readings do not become the measure of the next ones."""
    geometry = ArmGeometry.of(arm)
    commands = commands_with_a_hold(arm)
    readings = commands.copy()
    away = commands[HOLD] - geometry.action_neutral
    readings[HOLD] = geometry.action_neutral + WRONG[name](away)
    faults = faults_of(arm, readings, commands)
    assert all(faults[HOLD])
    assert not any(faults[: HOLD.start] + faults[HOLD.stop :])


def test_deviations_within_the_margin_are_no_fault(twin):
    commands = commands_of(twin)
    margin = 0.99 * MARGIN * ArmGeometry.of(twin).action_scale[:, None]
    assert not any(faults_of(twin, commands + margin, commands))


@pytest.mark.parametrize("cables", [None, np.zeros((1, 1)), np.full((3, 3), np.nan)])
def test_missing_cables_are_not_compared(twin, cables):
    monitor = FollowingMonitor(twin)
    values = {} if cables is None else {"cables": cables}
    assert not any(monitor.find_fault(Reading(0.0, values)) for _ in range(STEPS))


def test_a_reset_forgets_the_commands(twin):
    commands = commands_of(twin)
    monitor = FollowingMonitor(twin)
    for command in commands[:40]:
        monitor.sent(command)
    monitor.reset()
    rest = Reading(0.0, {"cables": ArmGeometry.of(twin).action_neutral})
    assert not any(monitor.find_fault(rest) for _ in range(STEPS))


ALTERED = {
    "enlarged": lambda away: 1.6 * away,
    "a thousand times": lambda away: 1000.0 * away,
    "turned around": lambda away: -away,
}


@pytest.mark.parametrize("rate", [10.0, 100.0])
@pytest.mark.parametrize("name", ALTERED)
def test_a_robot_that_says_it_alters_commands_is_found(arm, name, rate):
    arm = arm.model_copy(update={"control_rate": rate})
    rest = ArmGeometry.of(arm).action_neutral
    monitor = FollowingMonitor(arm)
    found = ""
    for command in commands_of(arm):
        sent = rest + ALTERED[name](command - rest)
        found = found or monitor.find_excess(sent, command)
        monitor.sent(sent)
    assert "may limit a command" in found


HONEST = {
    "limited in value": lambda last, command: np.clip(command, -0.5, 0.5),
    "limited in rate": lambda last, command: (
        last + np.clip(command - last, -0.02, 0.02)
    ),
    "smoothed": lambda last, command: last + 0.3 * (command - last),
    "halved": lambda last, command: 0.5 * command,
    "rounded": lambda last, command: np.round(command / 0.004) * 0.004,
    "with compensated backlash": lambda last, command: (
        command + 0.05 * np.sign(command - last)
    ),
}
"""Shares of the reach."""


@pytest.mark.parametrize("name", HONEST)
def test_a_robot_may_limit_round_and_compensate_commands(twin, name):
    reach = np.abs(ArmGeometry.of(twin).action_scale)[:, None]
    monitor = FollowingMonitor(twin)
    last = ArmGeometry.of(twin).action_neutral
    for command in commands_of(twin):
        last = reach * HONEST[name](last / reach, command / reach)
        assert not monitor.find_excess(last, command)
        monitor.sent(last)
