"""Faults of the simulated arm's sensors, on a made-up sensor of two modules."""

import numpy as np
import pytest

from s2c2a.arm.sensors import Camera, Sensors
from s2c2a.errors import S2C2AError
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.robots.simulation.sensor_faults import KINDS, MAX_LATENCY, SensorFaults

PERIOD = 0.1
FAULT_STEP = 5


def readings(kind, amount=0.0, steps=12) -> np.ndarray:
    """Values of a sensor that counts control steps, with a fault from step 5 on."""
    faults = SensorFaults(seed=0)
    seen = []
    for step in range(steps):
        if step == FAULT_STEP:
            faults.set("counter", kind, amount, step * PERIOD)
        values = np.array([[step, 1.0], [step, 2.0]])
        seen.append(faults.apply({"counter": values}, step * PERIOD)["counter"])
    return np.array(seen)


def test_before_a_fault_values_are_the_sensors():
    for kind in KINDS:
        np.testing.assert_array_equal(
            readings(kind, 1.0)[:FAULT_STEP], readings("repaired")[:FAULT_STEP]
        )


def test_every_fault_changes_the_values_as_documented():
    true = readings("repaired")[-1]
    np.testing.assert_allclose(readings("offset", 0.5)[-1], true + np.array([0.5, 0.0]))
    np.testing.assert_allclose(readings("drift", 2.0)[-1], true + np.array([1.2, 0.0]))
    np.testing.assert_allclose(readings("negated")[-1], -true)
    np.testing.assert_allclose(readings("reversed")[-1], true[::-1])
    np.testing.assert_allclose(readings("frozen")[-1][:, 0], FAULT_STEP)
    np.testing.assert_allclose(readings("latency", 0.3)[-1][:, 0], true[:, 0] - 3)
    noise = (readings("noise", 0.5, 500) - readings("repaired", steps=500))[FAULT_STEP:]
    assert noise.std() == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize("kind", KINDS)
def test_a_single_number_can_have_every_fault(kind):
    faults = SensorFaults(seed=0)
    faults.set("age", kind, 0.5, 0.0)
    assert np.shape(faults.apply({"age": np.array(0.2)}, 0.1)["age"]) == ()


def test_an_event_gives_a_fault_to_a_sensor_of_the_arm(twin):
    camera = Camera(rate=10.0, lost=0.0, delay=0.0, noise=0.0)
    arm = twin.model_copy(update={"sensors": Sensors(camera=camera)})
    event = "0.3 offset camera_positions 0.1"
    sound, faulty = SimulatedRobot(arm), SimulatedRobot(arm, events=event)
    offsets = []
    sound.open()
    faulty.open()
    for _ in range(6):
        for robot in (sound, faulty):
            robot.step(robot._geometry.action_neutral)
        difference = (
            faulty.read()["camera_positions"] - sound.read()["camera_positions"]
        )
        offsets.append(difference[-1])
    np.testing.assert_allclose(offsets[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(offsets[-1], [0.1, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ("1 drift gyroscope 1", "no sensor 'gyroscope'.*cables"),
        ("1 offset states 1", "no sensor 'states'"),
        ("1 latency cables 60", "not an event"),
        ("1 frozen", "not an event"),
        ("1 drift cables", "not an event"),
    ],
)
def test_a_fault_that_the_arm_cannot_have_is_refused(twin, event, message):
    with pytest.raises(S2C2AError, match=message):
        SimulatedRobot(twin, events=event)


def test_faults_that_repeat_past_values_do_so_however_long_they_last():
    for steps in (150, 1000):
        frozen = readings("frozen", steps=steps)
        np.testing.assert_allclose(frozen[FAULT_STEP:, :, 0], FAULT_STEP)
    slowest = readings("latency", MAX_LATENCY, steps=1000)[-1]
    np.testing.assert_allclose(slowest[:, 0], 999 - round(MAX_LATENCY / PERIOD))


def test_a_sensor_freezes_anew_at_every_fault():
    faults = SensorFaults(seed=0)
    values = []
    for step in range(6):
        if step in (1, 4):
            faults.set("counter", "frozen", 0.0, step * PERIOD)
        values.append(
            float(faults.apply({"counter": np.array(step)}, step * PERIOD)["counter"])
        )
    assert values == [0, 1, 1, 1, 4, 4]
