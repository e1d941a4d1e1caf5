"""The oscillation monitor: loop-made vibration is found, ordinary motion is not."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.goals import Goal
from s2c2a.runtime import Loop, StepRequest
from s2c2a.runtime.oscillation import OscillationMonitor
from s2c2a.spaces import Reading

NO_READING = Reading(0.0, {})
SECONDS = 6.0


def command_of(arm, degrees: float):
    """A command that bends the first module by an angle towards x."""
    geometry = ArmGeometry.of(arm)
    shares = np.zeros((arm.module_count, 2))
    shares[0, 0] = np.deg2rad(degrees) / geometry.action_bends[0]
    directions = np.einsum("mnk,mk->mn", geometry.cable_matrices, shares)
    return geometry.action_neutral + geometry.action_scale[:, None] * directions


def watch(arm, angle, seconds=SECONDS, goal=lambda time: None, reading=NO_READING):
    """The first vibration found and its time, while the command follows an angle."""
    monitor = OscillationMonitor(arm)
    for number in range(round(seconds * arm.control_rate)):
        time = number * arm.control_period
        desired = goal(time) or Goal.of(arm.module_count)
        found = monitor.update(command_of(arm, angle(time)), reading, desired)
        if found:
            return time, found
    return None, None


def sine(frequency: float, degrees: float):
    return lambda time: degrees * np.sin(2 * np.pi * frequency * time)


@pytest.mark.parametrize("rate", [10.0, 50.0])
@pytest.mark.parametrize("frequency", [0.6, 1.0, 2.0, 4.0])
def test_a_sustained_vibration_is_found_with_its_frequency(twin, rate, frequency):
    arm = twin.model_copy(update={"control_rate": rate})
    time, found = watch(arm, sine(frequency, 3.0))
    assert time <= max(3.0, 3.0 / frequency)
    assert (found.signal, found.module) == ("commands", 0)
    assert found.frequency == pytest.approx(frequency, rel=0.3)
    assert "commands of module 1 vibrate at" in str(found)


def test_a_command_that_reverses_in_every_step_is_found(twin):
    period = twin.control_period
    time, found = watch(twin, lambda time: 0.5 * (-1) ** round(time / period))
    assert time <= 3.0
    assert found.frequency == pytest.approx(0.5 / period, rel=0.1)


@pytest.mark.parametrize(
    "angle",
    [
        lambda time: 0.0,
        lambda time: 20.0 * min(time, 1.0),
        sine(0.05, 30.0),
        sine(0.2, 20.0),
        sine(2.0, 0.15),
        lambda time: 5.0 * np.exp(-time) * np.sin(2 * np.pi * time),
    ],
    ids=["rest", "a step", "the circle", "a fast circle", "noise", "a decay"],
)
def test_other_motion_is_no_vibration(twin, angle):
    assert watch(twin, angle, seconds=30.0) == (None, None)


def test_noise_is_no_vibration(twin):
    random = np.random.default_rng(0)
    assert watch(twin, lambda time: random.normal(0.0, 0.1), 60.0) == (None, None)


def test_motion_that_the_goal_asks_for_is_no_vibration(twin):
    frequency = 0.8

    def goal(time):
        offset = 0.1 * np.sin(2 * np.pi * frequency * time)
        return Goal.of(twin.module_count).with_position([offset, 0.0, 0.5])

    assert watch(twin, sine(frequency, 8.0), 20.0, goal) == (None, None)
    assert watch(twin, sine(frequency, 8.0), 20.0)[1] is not None


def test_readings_count_only_if_they_keep_vibrating(twin):
    monitor = OscillationMonitor(twin)
    rest = command_of(twin, 0.0)
    goal = Goal.of(twin.module_count)
    found = []
    for number in range(round(20.0 * twin.control_rate)):
        time = number * twin.control_period
        axes = np.tile([0.0, 0.0, 1.0], (twin.module_count, 1))
        axes[1, 0] = np.deg2rad(4.0) * np.sin(2 * np.pi * time)
        reading = Reading(time, {"configurations": axes})
        vibration = monitor.update(rest, reading, goal)
        if vibration:
            found.append((time, vibration))
    time, vibration = found[0]
    assert 5.0 < time < 10.0
    assert (vibration.signal, vibration.module) == ("configurations", 1)


def test_missing_and_broken_readings_are_ignored(twin):
    shape = (twin.module_count, twin.cable_count)
    monitor = OscillationMonitor(twin)
    goal = Goal.of(twin.module_count)
    for values in (np.full(shape, np.nan), np.zeros(2), None):
        reading = Reading(0.0, {"cables": values})
        assert monitor.update(command_of(twin, 0.0), reading, goal) is None


def turning(twin, time, degrees):
    """Angular velocities of a second module that vibrates at 1 Hz."""
    rates = np.zeros((5, twin.module_count, 3))
    amplitude = np.deg2rad(degrees) * 2 * np.pi
    rates[:, 1, 1] = 0.02 + amplitude * np.cos(2 * np.pi * time)
    return {"angular_velocities": rates}


def pictures(twin, time, degrees):
    """Pictures of the tip at half the control rate, as far as `degrees` around 1 Hz."""
    positions = np.full((twin.module_count, 3), np.nan)
    if round(time * twin.control_rate) % 2 == 0:
        swing = np.deg2rad(degrees) * twin.length
        positions[-1] = [swing * np.sin(2 * np.pi * time), 0.0, twin.length]
    return {"camera_positions": positions}


@pytest.mark.parametrize(
    ("sensed", "name", "module"),
    [(turning, "angular_velocities", 1), (pictures, "camera_positions", 2)],
)
def test_inertial_sensors_and_a_camera_show_a_vibration(twin, sensed, name, module):
    assert first_found(twin, sensed, 0.1) is None
    time, vibration = first_found(twin, sensed, 4.0)
    assert 5.0 < time < 10.0
    assert (vibration.signal, vibration.module) == (name, module)
    assert vibration.frequency == pytest.approx(1.0, rel=0.3)


def first_found(twin, sensed, degrees):
    """Time and vibration that the monitor reports while the command rests."""
    monitor = OscillationMonitor(twin)
    rest = command_of(twin, 0.0)
    goal = Goal.of(twin.module_count)
    for number in range(round(20.0 * twin.control_rate)):
        time = number * twin.control_period
        reading = Reading(time, sensed(twin, time, degrees))
        vibration = monitor.update(rest, reading, goal)
        if vibration:
            return time, vibration
    return None


def test_a_controller_that_vibrates_is_reported_and_a_player_may(puppet, actor, clock):
    for monitors, expected in ((True, "commands of module 1 vibrate"), (False, "")):
        with Loop(puppet, actor, clock, monitors_vibration=monitors) as loop:
            for number in range(40):
                actor.share = 0.3 + 0.05 * (-1) ** number
                record = loop.tick(StepRequest())
        assert record.vibration.startswith(expected)
        assert monitors or not record.vibration
