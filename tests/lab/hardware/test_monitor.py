"""Faults of servos and cables, and what is none."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm, servos_of
from s2c2a.lab.hardware.bus import HardwareError, ServoState
from s2c2a.lab.hardware.monitor import CableMonitor, describe_faults

SERVOS = servos_of(load_arm("twin_arm"))
IDS = range(1, 10)
SOUND = ServoState(0, 0.0, 0.1, 5.0, 30.0)
RATE = 10.0  # Hz
SHAPE = (3, 3)
NOTHING = np.zeros(SHAPE)
TAUT = np.full(SHAPE, 2.0)  # N


def fault_of(state):
    """Fault where the servo of module 2, cable 1 has a state, and others are sound."""
    states = dict.fromkeys(IDS, SOUND) | {4: state}
    states = {id: state for id, state in states.items() if state is not None}
    return describe_faults(states, SERVOS, IDS, restarted=())


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"errors": frozenset([HardwareError.OVERLOAD])}, "switched off: overloaded"),
        ({"errors": frozenset([HardwareError.OVERHEATED])}, "motors reboot"),
        ({"watchdog_tripped": True}, "stopped by itself: no command for 0.4 s"),
        ({"temperature": 65.5}, "66 deg C; the limit is 65"),
        ({"voltage": 3.9}, "3.9 V; allowed are 4 to 6"),
        ({"voltage": 6.1}, "6.1 V; allowed are 4 to 6"),
    ],
)
def test_a_fault_names_servo_place_and_cause(change, text):
    fault = fault_of(replace(SOUND, **change))
    assert fault.startswith("servo 4 (module 2, cable 1) ")
    assert text in fault


def test_a_servo_without_an_answer_is_named():
    assert fault_of(None) == "servo 4 (module 2, cable 1) does not answer"


@pytest.mark.parametrize(
    "change", [{}, {"temperature": 65.0}, {"voltage": 4.0}, {"voltage": 6.0}]
)
def test_sound_values_and_values_at_their_limits_are_no_fault(change):
    assert fault_of(replace(SOUND, **change)) == ""


def faults_over(seconds, goal, displacements, tensions, monitor=None):
    """Faults of repeated readings of the same values."""
    monitor = monitor or CableMonitor(SERVOS, RATE)
    return [
        monitor.find_fault(goal, displacements)
        or monitor.find_slack(displacements, tensions)
        for _ in range(round(seconds * RATE))
    ]


def bent(module=1, cable=2, wound=-0.01):
    """Displacements with one cable wound in [m]."""
    displacements = np.zeros(SHAPE)
    displacements[module, cable] = wound
    return displacements


def slack(module=1):
    """Tensions with one module without any [N]."""
    tensions = TAUT.copy()
    tensions[module] = 0.1
    return tensions


def test_a_module_without_tension_is_reported_after_two_seconds():
    faults = faults_over(2.5, bent(), bent(), slack())
    assert not any(faults[:19])
    assert all(
        fault.startswith("the cable of servo 6 (module 2, cable 3)")
        for fault in faults[19:]
    )


@pytest.mark.parametrize(("step", "friction"), [(-0.0004, 0.4), (0.0004, -0.4)])
def test_the_friction_of_a_moving_gear_is_no_tension(step, friction):
    monitor = CableMonitor(SERVOS, RATE)
    tensions = TAUT.copy()
    tensions[1] = 0.3 + friction
    faults = []
    for number in range(25):
        displacements = bent(wound=-0.02)
        displacements[1] += number * step
        faults.append(monitor.find_slack(displacements, tensions))
    assert not any(faults[:19])
    assert all("may have snapped" in fault for fault in faults[20:])


def test_a_servo_that_does_not_arrive_is_a_fault_after_a_second():
    faults = faults_over(1.5, bent(), NOTHING, TAUT)
    assert not any(faults[:9])
    assert all(
        fault.startswith("servo 6 (module 2, cable 3) does not follow")
        for fault in faults[9:]
    )


@pytest.mark.parametrize(
    ("displacements", "tensions"),
    [
        (NOTHING, TAUT),
        (bent(), TAUT),
        (bent(wound=-0.002), slack()),  # hardly wound in
        (bent(module=0), slack(1)),  # another module
        (bent(), np.where(np.arange(3) == 1, 1.0, slack())),  # others hold it
        (bent(), np.full(SHAPE, np.nan)),
        (np.full(SHAPE, np.nan), TAUT),
    ],
)
def test_what_is_no_fault_raises_no_alarm(displacements, tensions):
    assert not any(faults_over(5.0, displacements, displacements, tensions))


def test_missing_positions_are_no_stall():
    assert not any(faults_over(5.0, bent(), np.full(SHAPE, np.nan), TAUT))


def test_a_cable_that_is_slack_for_a_moment_is_no_fault():
    monitor = CableMonitor(SERVOS, RATE)
    faults = []
    for _ in range(10):
        faults += faults_over(1.9, bent(), bent(), slack(), monitor)
        faults += faults_over(0.1, bent(), bent(), TAUT, monitor)
    assert not any(faults)


def test_a_reset_forgets_what_was_measured():
    monitor = CableMonitor(SERVOS, RATE)
    faults_over(1.9, bent(), bent(), slack(), monitor)
    monitor.reset()
    assert not any(faults_over(1.9, bent(), bent(), slack(), monitor))
