"""Recordings of the live page grow on disk, for any time."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.episodes import EpisodeWriter, load_episodes
from s2c2a.errors import RecordingError, S2C2AError
from s2c2a.live import recorder
from s2c2a.live.recorder import Recorder
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.runtime import StepRecord, step_writer
from s2c2a.spaces import Reading, Stage
from waiting import until

ARM = load_arm("twin_arm")
STATES = np.tile([0.0, 0.0, 0.2, 0.0, 0.0, 1.0], (3, 1))


class Watched(Control):
    """A control whose steps a test makes."""

    arm = ARM
    number = 0

    def step(self, count: int = 1, **sensors) -> None:
        for _ in range(count):
            time, rest = 0.1 * self.number, np.zeros((3, 3))
            reading = Reading(time, {"cables": rest, **sensors})
            step = StepRecord(self.number, time, Stage.RUN, reading, None, rest)
            snapshot = Snapshot(
                step, Stage.RUN, STATES, STATES, 0.0, 0.0, np.inf, 0, 0, "pcc"
            )
            for watcher in list(self._watchers):
                watcher(snapshot)
            self.number += 1


Watched.__abstractmethods__ = frozenset()  # a test needs only what is watched


@pytest.fixture
def control(monkeypatch):
    monkeypatch.setattr(step_writer, "PIECE", 0.02)
    monkeypatch.setattr(recorder, "replay_page", lambda *_: None)
    return Watched()


@pytest.fixture
def running(control, tmp_path):
    """A recorder that records."""
    recorder = Recorder(control, tmp_path)
    recorder.start()
    return recorder


def steps_in(folder) -> int:
    count = 0
    for path in folder.rglob("*.episodes"):
        try:
            count += sum(map(len, load_episodes(path)[0]))
        except RecordingError:  # no whole piece yet
            continue
    return count


def test_a_recording_is_on_disk_before_it_ends(control, running, tmp_path):
    """A killed process leaves it so."""
    control.step(30)
    until(lambda: steps_in(tmp_path) == 30)
    control.step(12)
    until(lambda: steps_in(tmp_path) == 42)
    folder = running.stop()
    (episode,), _ = load_episodes(folder / "twin_arm.episodes")
    np.testing.assert_allclose(episode["time"], 0.1 * np.arange(42))


def test_a_recording_has_no_end_and_goes_on_in_further_files(
    control, running, tmp_path, monkeypatch
):
    monkeypatch.setattr(step_writer, "MAX_PIECES", 2)
    for part in range(1, 8):
        control.step(20)
        until(lambda part=part: steps_in(tmp_path) == 20 * part)
    folder = running.stop()
    files = sorted(folder.glob("*.episodes"))
    assert len(files) > 2
    assert all(len(load_episodes(file)[0]) == 1 for file in files)
    assert steps_in(folder) == 140


def test_a_sensor_that_comes_later_is_missing_before(control, running, tmp_path):
    control.step(10)
    until(lambda: steps_in(tmp_path) == 10)
    control.step(10, flex=np.ones((3, 2)))
    control.number = 0  # the arm was opened again
    control.step(5)
    (episode,), _ = load_episodes(running.stop() / "twin_arm.episodes")
    flex = episode["sensor.flex"]
    np.testing.assert_array_equal(
        np.isfinite(flex[:, 0, 0]), [False] * 10 + [True] * 10 + [False] * 5
    )
    assert (np.diff(episode["time"]) > 0).all()


@pytest.mark.parametrize("error", [RecordingError("no room"), TypeError("no JSON")])
def test_any_failure_to_write_is_reported_and_keeps_what_was_written(
    control, running, tmp_path, monkeypatch, error
):
    """A thread that ends silently would let the queue of steps grow for ever."""
    control.step(10)
    until(lambda: steps_in(tmp_path) == 10)

    def fail(*_):
        raise error

    monkeypatch.setattr(EpisodeWriter, "append", fail)
    control.step(10)
    until(lambda: running.error)
    with pytest.raises(S2C2AError, match=f"ended after 10 steps: .*{error}"):
        running.stop()
    assert steps_in(tmp_path) == 10


def test_two_recordings_in_a_second_have_two_folders(control, tmp_path):
    running = Recorder(control, tmp_path)
    for _ in range(2):
        running.start()
        control.step(3)
        assert running.stop() is not None
    assert len(list(tmp_path.iterdir())) == 2
    running.start()
    assert running.stop() is None
    assert len(list(tmp_path.iterdir())) == 2
