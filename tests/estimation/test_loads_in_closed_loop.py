"""The twin with what nobody told: found by what it sensors, and what goes wrong is left out."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.arm.sensors import Inertial, Sensors
from s2c2a.evaluation import position_errors, rollout
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading
from s2c2a.strategies import Watched, s2c2a_strategy, shipped_networks
from s2c2a.tasks import circle

TWIN = load_arm("twin_arm")
ARM = TWIN.model_copy(update={"sensors": Sensors(imu=Inertial())})
INERTIAL = ("accelerations", "angular_velocities")
FAULTY_FROM = 8.0  # s
LOAD = 0.05  # kg


class Failing(SimulatedRobot):
    """Its inertial sensors are gone, or say the same again and again."""

    fault = ""

    def open(self) -> Reading:
        self.kept = {}
        return super().open()

    def read(self) -> Reading:
        reading = super().read()
        said = dict(reading.sensors)
        for name in INERTIAL if reading.time > FAULTY_FROM and self.fault else ():
            said[name] = self.kept.setdefault(name, said[name])
            if self.fault == "gone":
                del said[name]
        return Reading(reading.time, said)


@pytest.fixture(scope="module")
def strategy():
    return s2c2a_strategy(replace(shipped_networks(ARM), arm=ARM))


def run(strategy, load=0.0, fault="", arm=ARM, happens=""):
    robot, task = Failing(arm, payload=load, happens=happens), circle(arm)
    robot.fault = fault
    episode = rollout(robot, strategy, task)
    return episode, position_errors(episode.after("states"), task.desired_positions())


def test_inertial_sensors_find_a_load_and_take_it_into_account(strategy):
    episode, errors = run(strategy, LOAD)
    assert episode.ran("load")[-1] == pytest.approx(LOAD, rel=0.3)
    assert errors.mean() < 0.8


def test_without_a_load_they_find_none_and_do_no_harm(strategy):
    episode, errors = run(strategy, 0.0)
    assert episode.ran("load")[60:].max() < 0.01
    assert errors.mean() < 0.9  # their zeros are off by half a degree


@pytest.mark.parametrize("fault", ["gone", "frozen"])
def test_what_was_found_stays_when_they_fail(strategy, fault):
    episode, errors = run(strategy, LOAD, fault)
    assert episode.ran("load")[-1] == pytest.approx(LOAD, rel=0.3)
    assert errors[100:].mean() < 1.2


def test_what_is_hung_on_while_it_works_is_a_load_and_no_fault(strategy):
    episode, errors = run(strategy, happens="4 load 0.1")
    assert not episode.ran("rejected.imu")[-100:].any()
    assert episode.ran("load")[-1] == pytest.approx(0.1, rel=0.3)
    assert errors[-50:].mean() < 2.5


def test_it_yields_to_a_push_as_far_as_it_should_and_comes_back():
    arm = TWIN.model_copy(update={"sensing": "true"})
    yielding = s2c2a_strategy(
        replace(shipped_networks(TWIN), arm=arm), watched=Watched(yields=0.1)
    )
    episode, errors = run(yielding, arm=arm, happens="4 push 0.5 0 0; 10 push 0 0 0")
    during, after = slice(60, 100), slice(140, None)
    assert errors[during].mean() > 5.0
    assert episode.ran("push").max() < 0.11
    assert errors[after].mean() < 0.6


def test_slipped_zeros_are_made_up_for():
    arm = TWIN.model_copy(update={"sensing": "true"})
    seeing = s2c2a_strategy(replace(shipped_networks(TWIN), arm=arm))
    _, errors = run(seeing, arm=arm, happens="2 homed 0.0005")
    assert errors[-60:].mean() < 0.7  # 0.3 without; some 2 if nothing was done


def test_the_next_start_knows_nothing_of_it(strategy):
    run(strategy, LOAD)
    episode, _ = run(strategy, 0.0)
    assert episode.ran("load")[0] < LOAD / 2


def test_a_word_is_enough_for_encoders_alone():
    told = s2c2a_strategy(shipped_networks(TWIN), watched=Watched(load=LOAD))
    episode, errors = run(told, LOAD, arm=TWIN)
    np.testing.assert_allclose(episode.ran("load"), LOAD, rtol=1e-6)
    assert errors.mean() < 1.0
