"""Unknown payloads, forces and faults in closed loop on the simulated arm."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.arm.sensors import Inertial, Sensors
from s2c2a.errors import StrategyError
from s2c2a.estimation import EstimationSettings
from s2c2a.evaluation import position_errors, rollout
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading
from s2c2a.strategies import recipe_named, s2c2a_strategy, shipped_networks
from s2c2a.tasks import circle
from s2c2a_experiments.sensors import with_sensors

TWIN = load_arm("twin_arm")
WITH_IMU = TWIN.model_copy(update={"sensors": Sensors(imu=Inertial())})
WITH_BENDS = TWIN.model_copy(update={"sensing": "true"})
IMU_SENSORS = ("accelerations", "angular_velocities")
FAULT_TIME = 8.0  # s
PAYLOAD = 0.05  # kg


class FailingRobot(SimulatedRobot):
    """Its inertial sensors disappear, or repeat their last samples."""

    fault = ""

    def open(self) -> Reading:
        self.last = {}
        return super().open()

    def read(self) -> Reading:
        reading = super().read()
        sensors = dict(reading.sensors)
        if self.fault and reading.time > FAULT_TIME:
            for name in IMU_SENSORS:
                sensors[name] = self.last.setdefault(name, sensors[name])
                if self.fault == "missing":
                    del sensors[name]
        return Reading(reading.time, sensors)


def strategy_for(arm, **settings):
    networks = replace(shipped_networks(TWIN), arm=arm)
    return s2c2a_strategy(networks, settings=EstimationSettings(**settings))


@pytest.fixture(scope="module")
def strategy():
    return strategy_for(WITH_IMU)


def run(strategy, payload=0.0, fault="", events=""):
    robot = FailingRobot(strategy.arm, payload=payload, events=events)
    robot.fault = fault
    task = circle(strategy.arm)
    episode = rollout(robot, strategy, task)
    errors = position_errors(episode.after("states"), task.desired_positions())
    return episode, errors


@pytest.fixture(scope="module")
def with_and_then_without(strategy):
    """A run with the payload and, of the same strategy, the next one without."""
    return run(strategy, PAYLOAD), run(strategy)


@pytest.mark.slow
def test_inertial_sensors_show_the_payload(with_and_then_without):
    (episode, errors), _ = with_and_then_without
    assert episode.ran("payload")[-1] == pytest.approx(PAYLOAD, rel=0.3)
    assert errors.mean() < 0.8


@pytest.mark.slow
def test_without_a_payload_they_do_no_harm(with_and_then_without):
    _, (episode, errors) = with_and_then_without
    assert episode.ran("payload")[60:].max() < 0.01
    assert errors.mean() < 0.9  # their biases are half a degree


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["missing", "frozen"])
def test_the_estimate_stays_when_they_fail(strategy, fault):
    episode, errors = run(strategy, PAYLOAD, fault)
    assert episode.ran("payload")[-1] == pytest.approx(PAYLOAD, rel=0.3)
    assert errors[100:].mean() < 1.2


@pytest.mark.slow
def test_a_payload_that_is_added_during_the_run_is_no_outlier(strategy):
    episode, errors = run(strategy, events="4 payload 0.1")
    assert not episode.ran("rejected.imu")[-100:].any()
    assert episode.ran("payload")[-1] == pytest.approx(0.1, rel=0.3)
    assert errors[-50:].mean() < 2.5


@pytest.mark.slow
def test_currents_show_a_payload_that_is_added_during_the_run():
    arm = with_sensors(TWIN, "current")
    episode, errors = run(strategy_for(arm), events="5 payload 0.1")
    assert not episode.ran("rejected.current").any()
    assert episode.ran("payload")[-1] == pytest.approx(0.1, rel=0.3)
    assert errors[-50:].mean() < 5.0


@pytest.mark.slow
def test_the_next_start_begins_without_an_estimate(with_and_then_without):
    _, (episode, _) = with_and_then_without
    assert episode.ran("payload")[0] < PAYLOAD / 2


@pytest.mark.slow
def test_the_arm_yields_to_a_force_beyond_the_limit_and_returns():
    yielding = strategy_for(WITH_BENDS, max_compensated_force=0.1)
    episode, errors = run(yielding, events="4 force 0.5 0 0; 10 force 0 0 0")
    assert errors[60:100].mean() > 5.0
    assert episode.ran("external_force").max() < 0.11
    assert errors[140:].mean() < 0.6


@pytest.mark.slow
def test_homing_errors_are_compensated():
    _, errors = run(strategy_for(WITH_BENDS), events="2 homing_error 0.0005")
    assert errors[-60:].mean() < 1.3  # 0.3 without the error, some 2 uncompensated


@pytest.mark.slow
def test_a_known_payload_needs_no_sensor():
    episode, errors = run(strategy_for(TWIN, known_payload=PAYLOAD), PAYLOAD)
    np.testing.assert_allclose(episode.ran("payload"), PAYLOAD, rtol=1e-6)
    assert errors.mean() < 1.0


def test_a_forward_model_that_ignores_payloads_refuses_them(tiny_networks):
    assert tiny_networks.recipe.c2s.model == recipe_named("paper").c2s.model
    with pytest.raises(StrategyError, match="ignores payloads"):
        s2c2a_strategy(tiny_networks, settings=EstimationSettings(PAYLOAD))
