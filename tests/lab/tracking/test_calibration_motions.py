import json
from dataclasses import replace
from itertools import cycle, repeat

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tracked_simulation import SimulatedTracker, TrackedSimulation

from s2c2a.arm import ArmGeometry, Tracking, load_arm
from s2c2a.errors import RobotError
from s2c2a.lab.tracking import Pose, TrackingError
from s2c2a.lab.tracking import calibration_motions as tracking
from s2c2a.lab.tracking.tracked_robot import calibration_of
from s2c2a.runtime import StepClock
from s2c2a.runtime.emergency import EMERGENCY_STOP, EmergencyStopError

ARM = load_arm("twin_arm")


class SilentTracker(SimulatedTracker):
    def start(self):
        pass


@pytest.mark.slow
def test_the_latency_of_a_simulated_tracker_is_found():
    robot = TrackedSimulation(ARM)
    tracker = SimulatedTracker(robot, latency=0.02, noise=0.001)
    found = tracking.measure_latency(robot, tracker, duration=6.0)
    assert abs(found.seconds - 0.02) < 0.003


@pytest.mark.slow
def test_the_frames_of_a_simulated_arm_are_found(monkeypatch, tmp_path):
    monkeypatch.setattr(tracking, "AVERAGING_TIME", 0.3)
    monkeypatch.setattr(tracking, "SETTLING_TIME", 0.8)
    base = Pose(
        np.array([0.01, 0.02, -0.03]),
        Rotation.from_rotvec([0.4, -0.2, 0.8]).as_quat(),
    )
    robot = TrackedSimulation(ARM)
    tracker = SimulatedTracker(robot, noise=0.001, base=base)
    file = tracking.CalibrationFile(ARM, tmp_path / "arm.tracking.json")
    found = tracking.measure_frames(robot, tracker, file)
    for one, true in zip(
        (found.base_offset, *found.end_offsets),
        (base, *[Pose.identity()] * 3),
        strict=True,
    ):
        error = one.inverse() @ true
        assert np.linalg.norm(error.position) < 0.001
        assert 2 * np.arccos(abs(error.rotation[3])) < np.deg2rad(0.4)


def test_the_chirp_stays_within_the_limits():
    rate = tracking.COMMAND_RATE
    bend = tracking.base_chirp(ARM, duration=20.0)
    geometry = ArmGeometry.of(ARM)
    speed = np.abs(np.diff(bend)).max() * rate
    acceleration = np.abs(np.diff(bend, 2)).max() * rate**2
    assert speed < geometry.step_limit * ARM.control_rate
    assert acceleration < geometry.acceleration_limit * ARM.control_rate**2


def test_an_arm_does_not_move_without_all_bodies(monkeypatch):
    monkeypatch.setattr("s2c2a.lab.tracking.states.FIRST_POSES", 0.05)
    monkeypatch.setattr(TrackedSimulation, "own_time", False)
    robot = TrackedSimulation(ARM)
    with pytest.raises(TrackingError, match="no poses of base, end-1"):
        tracking.measure_latency(robot, SilentTracker(robot))
    assert robot.data.time == 0.0


def test_an_emergency_stop_halts_the_arm_at_once():
    robot = TrackedSimulation(ARM)

    def stop_after_ten(done, total):
        if done == 10:
            EMERGENCY_STOP.trigger("a test")

    with pytest.raises(EmergencyStopError):
        tracking.measure_latency(
            robot, SimulatedTracker(robot), 5.0, progress=stop_after_ten
        )
    assert robot.data.time < 0.3


def test_each_result_changes_its_part_of_the_file_that_the_arm_file_names(tmp_path):
    path = tmp_path / "lab.json"
    arm = ARM.model_copy(update={"tracking": Tracking(calibration=str(path))})
    latency = tracking.Latency(0.02, 0.001, 0.99)
    assert tracking.CalibrationFile(arm).store_latency(latency) == path
    identity = Pose.identity()
    frames = tracking.Frames(identity, (identity,) * 3, np.zeros(3), np.zeros(3))
    tracking.CalibrationFile(arm).store_frames(frames)
    calibration = calibration_of(arm)
    assert calibration.latency == 0.02
    assert set(calibration.end_offsets) == {"end-1", "end-2", "end-3"}


def with_travel(travel):
    """The arm with cables of a travel [m]."""
    modules = tuple(
        module.model_copy(
            update={"cable": module.cable.model_copy(update={"travel": travel})}
        )
        for module in ARM.modules
    )
    return ARM.model_copy(update={"modules": modules})


@pytest.mark.parametrize("travel", [0.002, 0.008])
def test_held_bends_are_within_the_travel_of_the_cables(travel):
    arm = with_travel(travel)
    limits = ArmGeometry.of(arm).action_bends
    held = np.array(tracking.held_bends(arm))
    assert (np.linalg.norm(held, axis=-1) <= limits + 1e-9).all()
    assert np.allclose(held[:, 0].sum(axis=0), 0.0)
    assert np.abs(tracking.base_chirp(arm, 5.0)).max() <= limits[0]


def test_a_bend_out_of_reach_is_an_error_and_no_endless_motion():
    robot = TrackedSimulation(with_travel(0.008))
    bends = np.zeros((robot.arm.module_count, 2))
    bends[1, 0] = np.deg2rad(40.0)
    with pytest.raises(RobotError, match="module 2 shall bend by 40 deg"):
        tracking.play_motion(
            robot, SimulatedTracker(robot), lambda player: [player.action(bends)]
        )


class FaultyOnItsWay(TrackedSimulation):
    """Its readings have a fault from a time on."""

    def __init__(self, arm):
        super().__init__(arm)
        self.sent = []

    def send(self, action):
        self.sent.append(action)
        return super().send(action)

    def read(self):
        reading = super().read()
        return replace(reading, fault="a plug came off" if reading.time > 0.2 else "")


def bending(player):
    """A bend that is held for long."""
    bends = np.zeros((player.arm.module_count, 2))
    bends[0, 0] = np.deg2rad(10.0)
    return [player.action(bends)] * 500


def test_a_motion_ends_at_rest_after_a_lasting_fault(monkeypatch):
    monkeypatch.setattr(TrackedSimulation, "own_time", False)
    robot = FaultyOnItsWay(ARM)
    with pytest.raises(RobotError, match="the arm stopped: a plug came off"):
        play_in_real_time(robot, StepClock())
    assert np.abs(robot.sent).max() > 0.001
    assert np.allclose(robot.sent[-1], 0.0)


def play_in_real_time(robot, clock):
    """Play as on a real arm, with a fake clock and poses from the start."""
    tracker = SimulatedTracker(robot)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tracking, "await_poses", lambda *_: None)
        return tracking.play_motion(robot, tracker, bending, clock)


def late_robot(monkeypatch, clock, delays) -> TrackedSimulation:
    """An arm in real time whose readings take so long [s], one after the other."""
    monkeypatch.setattr(TrackedSimulation, "own_time", False)
    robot = TrackedSimulation(ARM)
    read = robot.read

    def read_late():
        clock.wait_until(clock.now() + next(delays))
        return replace(read(), time=clock.now())

    monkeypatch.setattr(robot, "read", read_late)
    return robot


def test_late_readings_are_left_out_and_the_motion_goes_on(monkeypatch):
    clock = StepClock()
    robot = late_robot(monkeypatch, clock, cycle([0.0, 0.1]))
    with pytest.warns(UserWarning, match="readings? of more than 20 ms left out"):
        player = play_in_real_time(robot, clock)
    assert len(player.times) > 50
    assert player.late == pytest.approx(len(player.times), abs=3)


def test_interrupted_frames_are_continued(monkeypatch, tmp_path):
    monkeypatch.setattr(tracking, "AVERAGING_TIME", 0.3)
    monkeypatch.setattr(tracking, "SETTLING_TIME", 0.0)
    monkeypatch.setattr(tracking, "find_frames", lambda arm, held: held)
    path = tmp_path / "arm.tracking.json"
    arm = ARM.model_copy(update={"modules": ARM.modules[:1]})
    whole = len(tracking.held_bends(arm))

    def measure(progress):
        robot = TrackedSimulation(arm)
        file = tracking.CalibrationFile(arm, path, ["this setup"])
        counts.append(len(file.held()))
        return tracking.measure_frames(robot, SimulatedTracker(robot), file, progress)

    def interrupt(done, total):
        if done == 4:
            raise KeyboardInterrupt

    counts = []
    with pytest.raises(KeyboardInterrupt):
        measure(interrupt)
    written = path.read_text()
    held = measure(lambda done, total: None)
    assert counts == [0, 4]
    assert len(held) == whole
    assert tracking.CalibrationFile(arm, path).held() == []
    # what was held of another setup, arm or bend is refused until it is forgotten
    stored = json.loads(written)
    bends = stored["unfinished"]["held"]
    bends[1], bends[2] = bends[2], bends[1]
    longer = arm.modules[0].model_copy(update={"length": 0.3})
    longer_arm = arm.model_copy(update={"modules": (longer,)})
    for one, setup, content in [
        (arm, "another setup", written),
        (longer_arm, "this setup", written),
        (arm, "this setup", json.dumps(stored)),
    ]:
        path.write_text(content)
        file = tracking.CalibrationFile(one, path, [setup])
        with pytest.raises(TrackingError, match="begin again with --overwrite"):
            file.held()
        file.store_held(())
        assert file.held() == []


def test_frames_end_if_all_readings_are_late(monkeypatch):
    clock = StepClock()
    robot = late_robot(monkeypatch, clock, repeat(0.03))
    with pytest.raises(RobotError, match=r"last one 30 ms.*`s2c2a motors timing`"):
        play_in_real_time(robot, clock)


def test_a_motion_does_not_go_on_after_a_standstill(monkeypatch):
    monkeypatch.setattr(TrackedSimulation, "own_time", False)
    clock = StepClock()
    robot = TrackedSimulation(ARM)
    advance = robot.advance

    def stand_still(seconds):
        advance(seconds)
        if 0.5 < clock.now() < 10.0:
            clock.wait_until(clock.now() + 30.0)

    monkeypatch.setattr(robot, "advance", stand_still)
    with pytest.raises(RobotError, match=r"stood still for 30\.0 s"):
        play_in_real_time(robot, clock)
