"""Collection: identical for any number of threads, stops, and resumes."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from made_up import TWIN, made_up
from s2c2a.arm import ArmGeometry
from s2c2a.arm.sensors import Camera, Sensors
from s2c2a.data import (
    CollectOptions,
    Recording,
    collect,
    describe_excluded,
    episode_actions,
    load_recording,
)
from s2c2a.errors import RecordingError, RobotError, S2C2AError
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Sensor, Stage

SMALL = CollectOptions(episodes=4, samples=12, seed=3)
SENSORS = {"cables", "states", "configurations"}


def assert_same(one, two) -> None:
    """Two recordings agree in every number."""
    assert one.arm == two.arm
    assert one.options == two.options
    assert set(one.sensors) == set(two.sensors)
    np.testing.assert_array_equal(one.time, two.time)
    np.testing.assert_array_equal(one.actions, two.actions)
    for name in one.sensors:
        np.testing.assert_array_equal(one.sensor(name), two.sensor(name), err_msg=name)


@pytest.fixture
def gather(twin, tmp_path):
    """Collects from the twin into a file of this name."""

    def run(
        name="one.episodes", arm=twin, options=SMALL, make=SimulatedRobot, **changes
    ):
        return collect(
            tmp_path / name, arm, lambda seed: make(arm, seed=seed), options, **changes
        )

    return run


def test_one_thread_and_two_record_the_same(gather):
    assert_same(gather("one.episodes", threads=1), gather("two.episodes", threads=2))


def test_a_recording_keeps_its_options(gather, twin):
    made = gather(robot="simulation fast")
    assert made.arm == twin
    assert set(made.sensors) == SENSORS
    chosen = {
        "babbling": "staged",
        "episodes": 4,
        "samples": 12,
        "seed": 3,
        "slowest": 0.03,
        "fastest": 0.22,
    }
    assert made.options == chosen | {"robot": "simulation fast"}


def test_speeds_scale_with_the_step_limit(gather, twin):
    quick = gather(
        "quick.episodes",
        twin.model_copy(update={"step_limit_deg": 2 * twin.step_limit_deg}),
    )
    geometry = ArmGeometry.of(twin)
    for episode in range(4):
        actions = episode_actions(geometry, "staged", episode, 4, 12, 3, (0.06, 0.44))
        np.testing.assert_array_equal(quick.actions[episode], actions)


def test_every_sample_is_the_reading_before_its_action(gather, twin):
    """Driven again by hand, episode by episode, with the actions that babbling says."""
    made, random = gather(), np.random.default_rng(0)
    episode = int(random.integers(4))
    actions = episode_actions(ArmGeometry.of(twin), "staged", episode, 4, 12, 3)
    np.testing.assert_array_equal(made.actions[episode], actions)
    with SimulatedRobot(twin) as robot:
        for step, action in enumerate(actions):
            reading = robot.read()
            assert made.time[episode, step] == reading.time
            for name in ("states", "configurations"):
                np.testing.assert_array_equal(
                    made.sensor(name)[episode, step], reading[name]
                )
            robot.step(action)


def test_each_episode_has_its_own_noise(gather):
    first_readings = gather().sensor("cables")[:, 0]
    assert len(np.unique(first_readings.reshape(4, -1), axis=0)) == 4


def test_sent_actions_are_recorded(gather):
    class Weak(SimulatedRobot):
        def send(self, action):
            return super().send(0.5 * np.asarray(action))

    np.testing.assert_allclose(
        gather("weak.episodes", make=Weak).actions, 0.5 * gather().actions
    )


def with_sensors(change):
    """The simulated robot, whose readings have the sensors of a function of them."""

    class Changed(SimulatedRobot):
        def read(self):
            reading = super().read()
            return replace(reading, sensors=change(reading))

    return Changed


def test_sensors_that_a_robot_lacks_are_not_in_the_recording(gather):
    class Unwatched(with_sensors(lambda reading: {"cables": reading["cables"]})):
        @property
        def sensors(self):
            return {"cables": super().sensors["cables"]}

    made = gather(make=Unwatched)
    assert made.sensors == ["cables"]
    assert np.isfinite(made.sensor("cables")).all()


def test_a_custom_sensor_of_a_robot_is_recorded(gather):
    def warmed(reading):
        return reading.sensors | {"warmth": np.array([300.0, reading.time])}

    class Warm(with_sensors(warmed)):
        @property
        def sensors(self):
            return super().sensors | {"warmth": Sensor((2,), "K")}

    made = gather(make=Warm)
    np.testing.assert_array_equal(made.sensor("warmth")[..., 1], made.time)


def test_a_camera_with_missing_measurements_is_recorded(gather, twin):
    arm = twin.model_copy(
        update={
            "sensors": Sensors(camera=Camera(rate=5.0, lost=0.0, noise=0.0, delay=0.0))
        }
    )
    made = gather(arm=arm)
    seen, true = made.sensor("camera_positions"), made.sensor("states")[..., :3]
    known = np.isfinite(seen)
    assert 0.3 < known.any(axis=(2, 3)).mean() < 0.6  # of samples, every other one
    assert not known[..., :2, :].any()  # of all but the tip
    np.testing.assert_allclose(seen[known], true[known], atol=1e-3)


@pytest.mark.parametrize("value", [np.nan, 1e6])
def test_an_episode_with_a_failed_sensor_is_dropped_and_can_be_resumed(
    gather, tmp_path, value
):
    """Whatever the sensor is: all that is recorded counts."""

    def spoilt(reading):
        cables = np.full((3, 3), value) if reading.time > 0.75 else reading["cables"]
        return reading.sensors | {"cables": cables}

    seen = []

    def make(seed):
        seen.append(seed)
        kind = with_sensors(spoilt) if len(seen) == 3 else SimulatedRobot
        return kind(TWIN, seed=seed)

    with pytest.raises(
        RecordingError,
        match=r"episode 3, step 12: 'cables' is .*; correct that, then continue \(--res",
    ):
        collect(tmp_path / "one.episodes", TWIN, make, SMALL, threads=1)
    assert len(load_recording(tmp_path / "one.episodes").episodes) == 2
    assert_same(gather(resume=True), gather("whole.episodes"))


def test_a_short_gap_is_interpolated_and_marked_by_its_stage(gather):
    def lossy(reading):
        is_lost = round(reading.time * TWIN.control_rate) in (4, 5)
        cables = np.where(is_lost, np.nan, reading["cables"])
        return reading.sensors | {"cables": cables}

    episode = gather(make=with_sensors(lossy)).episodes[0]
    cables = episode["sensor.cables"]
    assert np.isfinite(cables).all()
    expected = np.linspace(cables[3], cables[6], 4)
    np.testing.assert_allclose(cables[3:7], expected, atol=1e-5)
    assert np.flatnonzero(episode["stage"] == Stage.HOLD).tolist() == [4, 5]


class _Torn(SimulatedRobot):
    """Robot that counts openings and closings; the second one fails."""

    opened: list
    closed: list

    def open(self):
        reading = super().open()
        self.opened.append(self)
        return reading

    def close(self):
        self.closed.append(self)

    def send(self, action):
        if self.opened[1:2] == [self] and self.data.time > 0.45:
            raise OSError("cable torn")
        return super().send(action)


@pytest.fixture
def torn():
    """A fresh kind of torn robot."""
    return type("Torn", (_Torn,), {"opened": [], "closed": []})


@pytest.mark.parametrize(("threads", "most"), [(1, 2), (2, 4)])
def test_after_a_failure_every_robot_is_closed_and_one_thread_opens_no_other(
    gather, torn, threads, most
):
    """One thread is a real arm: it must not continue with a torn cable."""
    with pytest.raises(RobotError, match="cable torn"):
        gather(make=torn, threads=threads)
    assert 2 <= len(torn.opened) <= most
    assert set(torn.closed) == set(torn.opened)


def test_after_an_interrupt_complete_episodes_are_kept_and_resumed(gather, tmp_path):
    def stop(done, total):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        gather(progress=stop)
    assert len(load_recording(tmp_path / "one.episodes").time) == 2
    told = []
    resumed = gather(resume=True, progress=lambda *counts: told.append(counts))
    assert told == [(2, 4), (3, 4), (4, 4)]
    assert_same(resumed, gather("whole.episodes"))


def test_resuming_a_complete_or_missing_file_collects_what_is_missing(gather):
    fresh = gather(resume=True)
    assert_same(gather(resume=True), fresh)


def test_an_existing_file_is_not_overwritten_by_default(gather, tmp_path):
    gather()
    before = (tmp_path / "one.episodes").read_bytes()
    with pytest.raises(RecordingError, match=r"exists.*resume.*overwrite"):
        gather(options=replace(SMALL, seed=4))
    assert (tmp_path / "one.episodes").read_bytes() == before
    assert gather(options=replace(SMALL, seed=4), overwrite=True).options["seed"] == 4


OTHERS = {
    "seed": replace(SMALL, seed=4),
    "samples": replace(SMALL, samples=13),
    "episodes": replace(SMALL, episodes=5),
    "babbling": replace(SMALL, babbling="motor"),
    "fastest": replace(SMALL, speeds=(0.03, 0.2)),
}


@pytest.mark.parametrize(("name", "options"), OTHERS.items(), ids=OTHERS)
def test_resuming_with_other_options_is_refused_and_leaves_the_file_alone(
    gather, tmp_path, name, options
):
    gather()
    before = (tmp_path / "one.episodes").read_bytes()
    with pytest.raises(RecordingError, match=rf"other options \({name} \S+, now \S+\)"):
        gather(options=options, resume=True)
    assert (tmp_path / "one.episodes").read_bytes() == before


def test_resuming_with_another_arm_or_robot_is_refused(gather, twin):
    gather(robot="simulation fast")
    with pytest.raises(
        RecordingError, match=r"robot 'simulation fast', now 'simulation accurate'"
    ):
        gather(robot="simulation accurate", resume=True)
    with pytest.raises(
        RecordingError, match=r"another arm .*\(arm\.control_rate 10\.0, now 20\.0\)"
    ):
        gather(
            arm=twin.model_copy(update={"control_rate": 20.0}),
            robot="simulation fast",
            resume=True,
        )
    gather(robot="simulation fast", resume=True)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ({"babbling": "baby"}, "staged, motor"),
        ({"episodes": 0}, "out of range"),
        ({"samples": 0.5}, "out of range"),
        ({"seed": 2**31}, "2147483647 for the seed"),
        ({"speeds": (0.0, 0.2)}, "must rise from above 0 to at most 1"),
        ({"speeds": (0.2, 0.1)}, "must rise"),
        ({"speeds": (0.1, 1.1)}, "must rise"),
        ({"speeds": (np.nan, 0.2)}, "must rise"),
    ],
)
def test_invalid_options_are_refused(fault, message):
    with pytest.raises(RecordingError, match=message):
        CollectOptions(**fault)


@pytest.mark.parametrize("threads", [0, -1])
def test_an_invalid_number_of_threads_is_refused_before_a_file_is_created(
    gather, tmp_path, threads
):
    with pytest.raises(S2C2AError, match="give at least one"):
        gather(threads=threads)
    assert list(tmp_path.iterdir()) == []


def test_an_unfinished_temporary_file_does_no_harm(gather, tmp_path):
    left = tmp_path / f".one.episodes.{os.getpid()}.part"
    left.write_bytes(b"cut off while it was laid out")
    assert_same(gather(), gather("two.episodes"))
    assert not left.exists()


KILLED = """
import sys
from s2c2a.arm import load_arm
from s2c2a.data import CollectOptions, collect
from s2c2a.robots.simulation import SimulatedRobot

arm = load_arm("twin_arm")
options = CollectOptions(episodes=12, samples=40)
collect(sys.argv[1], arm, lambda seed: SimulatedRobot(arm, seed=seed), options,
        threads=2, resume=True, progress=lambda done, total: print(done, flush=True))
"""


def test_a_run_killed_and_resumed_at_random_equals_an_uninterrupted_run(
    gather, tmp_path
):
    path, random = tmp_path / "killed.episodes", np.random.default_rng(0)
    running = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, text=True
    )
    for _ in range(random.integers(2, 5)):
        running.stdout.readline()
    time.sleep(random.uniform(0.0, 0.03))
    os.kill(running.pid, signal.SIGKILL)
    running.communicate()
    assert running.returncode == -signal.SIGKILL
    assert 0 < len(load_recording(path).episodes) < 12
    options = CollectOptions(episodes=12, samples=40)
    resumed = gather("killed.episodes", options=options, resume=True)
    assert_same(resumed, gather("whole.episodes", options=options))


def test_no_empty_recording_stays_when_the_robot_never_opened(gather, tmp_path):
    class NeverTracked(SimulatedRobot):
        def open(self):
            raise RobotError("no pose arrived")

    with pytest.raises(RobotError, match="no pose arrived"):
        gather(make=NeverTracked, threads=1)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("counts", "text"),
    [
        ((0, 0), ""),
        ((3, 3), "excluded 3 of 12 poses: 3 frozen"),
        ((4, 1), "1 frozen (the last pose of a lost body again), 3 that the cables"),
        ((2, 0), "excluded 2 of 12 poses: 2 that the cables do not explain"),
    ],
)
def test_frozen_poses_are_counted_apart_from_marker_jumps(counts, text):
    options = dict(zip(("excluded_poses", "frozen_poses"), counts, strict=True))
    states = {"sensor.states": np.zeros((4, 3, 6))}
    episode = made_up(4, **states).with_options(**options)
    described = describe_excluded(Recording(TWIN, {}, (episode,)))
    assert text in described
    assert bool(described) == bool(counts[0])
