from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.lab.tracking.latency import LatencyError, MotionRecord, find_latency

from marks import slow_after

ARM = load_arm("twin_arm")
OMEGA = 2 * np.pi * 1.5
DAMPING = 0.14
STEP = 0.001


def record_of(latency, size=0.2):
    """Ends that follow an exact mode of 1.5 Hz, with noise of 0.5 mm."""
    times = np.arange(0.0, 20.0, STEP)
    growth = np.log(2.5 / 0.2) / 20.0
    phase = 2 * np.pi * 0.2 * (np.exp(growth * times) - 1) / growth
    bend = size * np.sin(phase) * np.exp(-growth * times / 2)
    response = vibrate(bend)
    frames = np.arange(0.003, 19.8, 1 / 120)
    positions = np.zeros((len(frames), 3, 3))
    for module, gain in enumerate((0.1, 0.3, 0.5)):
        positions[:, module, 1] = gain * np.interp(frames, times, response)
    positions += np.random.default_rng(0).normal(0.0, 5e-4, positions.shape)
    readings = np.arange(0.0, 20.0, 0.02)
    return MotionRecord(
        readings,
        cables_at(np.interp(readings, times, bend)),
        frames + latency,
        positions,
    )


def vibrate(bend):
    position = 0.0
    velocity = 0.0
    response = np.empty_like(bend)
    for step, value in enumerate(bend):
        spring = OMEGA**2 * (value - position)
        velocity += STEP * (spring - 2 * DAMPING * OMEGA * velocity)
        position += STEP * velocity
        response[step] = position
    return response


def cables_at(bend):
    geometry = ArmGeometry.of(ARM)
    shares = np.zeros((len(bend), 3, 2))
    shares[:, 0, 1] = bend / geometry.action_bends[0]
    return geometry.actions_at(shares)


@pytest.mark.parametrize("latency", slow_after(1, [0.08, 0.005]))
def test_the_latency_is_not_the_lag_of_the_arm(latency):
    found = find_latency(ARM, record_of(latency))
    assert abs(found.seconds - latency) < 0.003
    assert found.std < 0.005


def test_too_little_motion_is_refused():
    with pytest.raises(LatencyError, match="the arm moved by"):
        find_latency(ARM, record_of(0.02, size=0.01))


def test_a_tracker_that_shows_no_motion_of_the_arm_is_refused():
    record = record_of(latency=0.0)
    still = replace(record, positions=np.zeros_like(record.positions))
    with pytest.raises(LatencyError, match="stand still"):
        find_latency(ARM, still)
    few = replace(
        record,
        arrival_times=record.arrival_times[:50],
        positions=record.positions[:50],
    )
    with pytest.raises(LatencyError, match="frames with all module ends"):
        find_latency(ARM, few)


@pytest.mark.slow
def test_a_tracker_of_something_else_is_refused():
    record = record_of(latency=0.0)
    random = np.random.default_rng(1)
    walk = random.normal(0.0, 0.002, record.positions.shape).cumsum(axis=0)
    arrivals = record.arrival_times[:800]
    other = replace(record, arrival_times=arrivals, positions=walk[:800, :1])
    with pytest.raises(LatencyError):
        find_latency(ARM, other)
