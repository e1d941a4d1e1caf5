"""A robot with tracked module ends."""

import time
import warnings

import numpy as np
import pytest

from s2c2a.arm import Tracking, load_arm
from s2c2a.arm.sensors import Camera, Sensors
from s2c2a.errors import S2C2AError
from s2c2a.lab.tracking import (
    Pose,
    PoseFrame,
    TrackedRobot,
    Tracker,
    TrackingCalibration,
)
from s2c2a.lab.tracking.calibration import calibration_path, save_tracking_calibration
from s2c2a.lab.tracking.plausibility import PERSISTENCE
from s2c2a.robots import Robot, RobotFactory
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading, Sensor

ARM = load_arm("twin_arm")
CABLES = np.zeros((3, 3))
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


class StillRobot(Robot):
    """A real robot that stands straight."""

    def __init__(self, arm):
        self.arm = arm
        self.calls = []

    @property
    def sensors(self):
        return {"cables": Sensor((3, 3), "m")}

    def open(self):
        self.calls.append("open")
        return self.read()

    def read(self):
        return Reading(time.perf_counter(), {"cables": CABLES})

    def send(self, action):
        self.calls.append("send")
        return action

    def halt(self):
        self.calls.append("halt")

    def close(self):
        self.calls.append("close")


class StillTracker(Tracker):
    """Poses of a straight arm; a new frame for each `show`."""

    def __init__(self, names=("base", "end-1", "end-2", "end-3")):
        self.names = names
        self.frame = None
        self.number = 0
        self.closed = False

    def show(self, age=0.0, **shifts):
        """The next frame; some bodies are shifted along x [m]."""
        now = time.perf_counter() - age
        poses = {
            name: Pose(np.array([shifts.get(name, 0.0), 0.0, 0.2 * place]), NO_TURN)
            for place, name in enumerate(self.names)
        }
        self.frame = PoseFrame(now, now, self.number, poses)
        self.number += 1

    def start(self):
        self.show()

    def latest(self):
        return self.frame

    def close(self):
        self.closed = True


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def tracked(arm=ARM, tracker=None):
    tracker = tracker or StillTracker()
    return TrackedRobot(StillRobot(arm), "test", tracker), tracker


def test_readings_have_the_states_of_the_tracker_and_commands_reach_the_robot():
    robot, tracker = tracked()
    with robot:
        tracker.show()
        reading = robot.read()
        robot.send(CABLES)
        robot.halt()
    assert set(reading.sensors) == {"cables", "states", "states_age"}
    np.testing.assert_allclose(reading["states"][:, 2], [0.2, 0.4, 0.6])
    assert 0.0 <= reading["states_age"] < ARM.control_period
    assert tracker.closed
    assert robot._robot.calls == ["open", "send", "halt", "close"]


def test_states_of_a_silent_tracker_are_missing():
    robot, tracker = tracked()
    with robot:
        tracker.show(age=2.0 * ARM.control_period)
        reading = robot.read()
    assert np.isnan(reading["states"]).all()
    assert "states_age" not in reading.sensors


@pytest.mark.parametrize(
    ("names", "problem"),
    [
        (("base", "end-1", "end-3"), "tracking test: no poses of end-2 arrive"),
        (("base", "end-2", "end-1", "end-3"), "end of module 2 does not fit"),
    ],
)
def test_an_arm_does_not_move_without_all_poses(monkeypatch, names, problem):
    monkeypatch.setattr("s2c2a.lab.tracking.states.FIRST_POSES", 0.05)
    robot, _ = tracked(tracker=StillTracker(names))
    with pytest.raises(S2C2AError, match=problem):
        robot.open()
    assert robot._robot.calls == []


def test_an_impossible_state_is_missing_and_reported_once():
    robot, tracker = tracked()
    with robot:
        tracker.names = ("base", "end-2", "end-1", "end-3")
        tracker.show()
        with pytest.warns(UserWarning, match="end of module 2"):
            reading = robot.read()
        tracker.show()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            again = robot.read()
    assert np.isnan(reading["states"][1]).all()
    assert np.isnan(again["states"][1]).all()


def test_a_frame_that_is_read_again_does_not_confirm_a_jump():
    robot, tracker = tracked()
    with robot:
        tracker.show(**{"end-3": 0.05})
        with pytest.warns(UserWarning, match="module 3 has jumped"):
            readings = [robot.read() for _ in range(2 * PERSISTENCE)]
    assert all(np.isnan(reading["states"][2]).all() for reading in readings)


def test_a_frozen_end_is_missing_and_reported_once(monkeypatch):
    monkeypatch.setattr("s2c2a.lab.tracking.frozen_bodies.RESPONSE", 0.0)
    robot, tracker = tracked()
    pulled = CABLES.copy()
    pulled[0, 0] = 0.005
    with robot, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for step, command in enumerate([CABLES, pulled, pulled, pulled, pulled]):
            robot.send(command)
            moved = {"end-1": 1e-5 * step, "end-3": 1e-5 * step}
            tracker.show(**moved)
            states = robot.read()["states"]
        tracker.show(**{"end-2": 1e-5})
        again = robot.read()["states"]
    assert np.isnan(states).all(axis=1).tolist() == [False, True, False]
    assert np.isfinite(again).all()
    (warning,) = caught
    assert "module 2 is frozen" in str(warning.message)


def test_a_jump_of_all_ends_is_reported_once_and_removes_nothing():
    arm = ARM.model_copy(update={"tracking": Tracking(base="")})
    robot, tracker = tracked(arm)
    with robot, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for step in range(100):
            shift = 0.0058 * (step // 40)
            tracker.show(**dict.fromkeys(tracker.names, shift))
            assert np.isfinite(robot.read()["states"]).all()
    (warning,) = caught
    assert "all tracked ends jump by 5.8 mm" in str(warning.message)


def test_the_arm_file_names_the_bodies():
    tracking = Tracking(base="", ends=("", "", "tip"))
    arm = ARM.model_copy(update={"tracking": tracking})
    robot, tracker = tracked(arm, StillTracker(("other", "a", "b", "tip")))
    with robot:
        tracker.show()
        states = robot.read()["states"]
    assert np.isnan(states[:2]).all()
    np.testing.assert_allclose(states[2, :3], [0, 0, 0.6])


def test_the_calibration_of_the_arm_is_used():
    offset = {"end-3": Pose(np.array([0.0, 0.0, 0.01]), NO_TURN)}
    calibration = TrackingCalibration.empty(ARM).with_latency(0.03, 0.001)
    calibration = calibration.with_frames(Pose.identity(), offset, {})
    save_tracking_calibration(calibration, calibration_path(ARM))
    robot, tracker = tracked()
    with robot:
        tracker.show()
        reading = robot.read()
    assert reading["states"][2, 2] == pytest.approx(0.61)
    assert 0.03 <= reading["states_age"] < 0.03 + ARM.control_period


def test_a_camera_is_slow_feedback_from_the_tracker():
    camera = Camera(rate=2.0, sees="tip")
    arm = ARM.model_copy(update={"sensors": Sensors(camera=camera)})
    robot, tracker = tracked(arm)
    first = robot.open()
    tracker.show()
    second = robot.read()
    robot.close()
    assert np.isnan(first["camera_positions"][:2]).all()
    np.testing.assert_allclose(first["camera_positions"][2], [0, 0, 0.6])
    assert first["camera_age"] == first["states_age"]
    assert "camera_positions" not in second.sensors  # the next picture is not due


def test_a_robot_that_measures_states_or_has_its_own_time_is_not_tracked():
    robot = StillRobot(ARM)
    sensors = {"states": Sensor((3, 6), "m")}
    robot.__class__ = type("Measuring", (StillRobot,), {"sensors": sensors})
    with pytest.raises(S2C2AError, match="measures states itself"):
        TrackedRobot(robot, "test", StillTracker())
    with pytest.raises(S2C2AError, match="leave out --tracking"):
        TrackedRobot(SimulatedRobot(ARM), "test", StillTracker())


def test_the_factory_adds_the_source_of_the_arm_file_or_of_the_command():
    name = f"{__name__}:StillRobot"
    arm = ARM.model_copy(update={"tracking": Tracking(source="udp:0")})
    for factory, described, kind in [
        (RobotFactory(name), ARM, "StillRobot"),
        (RobotFactory(name), arm, "TrackedRobot"),
        (RobotFactory(name, tracking="udp:0"), ARM, "TrackedRobot"),
        (RobotFactory(name, tracking="none"), arm, "StillRobot"),
        (RobotFactory(), arm, "SimulatedRobot"),
    ]:
        assert type(factory.make(described)).__name__ == kind
