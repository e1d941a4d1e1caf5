"""Steps of a run: streamed, on disk while a real arm runs, kept if it is interrupted."""

import time
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from s2c2a import evaluation
from s2c2a.arm import load_arm
from s2c2a.episodes import load_episodes
from s2c2a.errors import RecordingError, S2C2AError
from s2c2a.jobs import Cache, Job
from s2c2a.live.cli import view
from s2c2a.runtime import StepRecord, build_episode, step_writer
from s2c2a.spaces import Reading, Stage
from s2c2a.strategies import recipe_named
from s2c2a.tasks import load_task

ARM = load_arm("twin_arm")


@pytest.fixture
def job():
    return Job(load_task("circle", ARM), ARM, "pcc", recipe_named("best"))


def test_an_earlier_interrupted_run_is_not_taken_for_this_one(
    job, tmp_path, monkeypatch
):
    def fail(*_, **__):
        raise S2C2AError("the port is in use")

    monkeypatch.setattr(evaluation, "rollout", fail)
    earlier = job.path(Cache(tmp_path)).with_name(f"interrupted-{job.file}")
    earlier.parent.mkdir(parents=True, exist_ok=True)
    earlier.touch()
    with pytest.raises(S2C2AError) as caught:
        job.make(Cache(tmp_path), lambda *_: None)
    assert str(caught.value) == "the port is in use"


def step(number: int) -> StepRecord:
    states = np.tile([0.0, 0.0, 0.2, 0.0, 0.0, 1.0], (3, 1))
    reading = Reading(0.1 * number, {"cables": np.zeros((3, 3)), "states": states})
    return StepRecord(number, 0.1 * number, Stage.RUN, reading, None, np.zeros((3, 3)))


def steps_in(path) -> int:
    try:
        return sum(map(len, load_episodes(path)[0]))
    except S2C2AError:  # no whole piece yet
        return 0


def test_steps_of_a_real_arm_are_on_disk_while_it_runs(job, tmp_path, monkeypatch):
    """A killed process leaves them so; it reads as one episode."""
    monkeypatch.setattr(step_writer, "PIECE", 0.02)
    shown = []
    monkeypatch.setattr(
        "s2c2a.live.viewing.view_runs", lambda traces, arm, port: shown.extend(traces)
    )
    path = job.path(Cache(tmp_path)).with_name(f"running-{job.file}")
    with job._steps_on_disk(SimpleNamespace(own_time=False), Cache(tmp_path)) as add:
        for number in range(30):
            add(step(number))
            if number == 15:
                time.sleep(0.05)
        end = time.monotonic() + 300
        while steps_in(path) < 30 and time.monotonic() < end:
            time.sleep(0.01)
        assert steps_in(path) == 30
        assert len(load_episodes(path)[0]) > 1
        view.open_window((str(path),), 0)
    assert [len(trace.episode) for trace in shown] == [30]
    assert shown[0].episode.options["task"] == "circle"
    assert list(path.parent.iterdir()) == []


def test_a_real_arm_that_differs_from_its_model_is_reported_while_it_runs(
    job, tmp_path, monkeypatch
):
    monkeypatch.setattr(step_writer, "PIECE", 0.02)
    watch = Mock(text="far off")
    monkeypatch.setattr(evaluation, "DisagreementWatch", lambda arm: watch)
    robot = SimpleNamespace(own_time=False)
    with (
        pytest.warns(UserWarning, match="far off"),
        job._steps_on_disk(robot, Cache(tmp_path)) as add,
    ):
        add(step(0))
    watch.add.assert_called_once()


def test_a_simulated_run_writes_no_steps(job, tmp_path):
    with job._steps_on_disk(SimpleNamespace(own_time=True), Cache(tmp_path)) as add:
        add(step(0))
    assert list(tmp_path.rglob("*")) == []


def test_steps_of_a_job_are_streamed_and_no_part_of_its_result(
    job, tmp_path, monkeypatch
):
    steps = [step(number) for number in range(3)]
    monkeypatch.setattr(evaluation, "rollout", run_of(*steps))
    shown = []
    streamed = replace(job, on_step=shown.append)
    streamed.make(Cache(tmp_path), lambda *_: None)
    assert shown == steps
    assert streamed.file == job.file
    assert streamed == job


@pytest.fixture
def real(monkeypatch):
    """Real arm of a job; strategies and robots are not made."""
    robot = SimpleNamespace(own_time=False)
    monkeypatch.setattr(Job, "robot", lambda self: robot)
    return robot


def run_of(*steps, error=None, kept=()):
    """A rollout that does steps, and may fail."""

    def rollout(*_, keep, on_step, **__):
        for each in steps:
            on_step(each)
        for number in kept:
            keep(build_episode([step(number)], ARM))
        if error is not None:
            raise error
        return build_episode(steps, ARM)

    return rollout


def files_after(job, folder):
    """Files beside the result, and the error, of a run."""
    with suppress(S2C2AError, OSError, KeyboardInterrupt):
        job.make(Cache(folder), lambda *_: None)
    names = [path.name for path in job.path(Cache(folder)).parent.iterdir()]
    return sorted(name.removesuffix(job.file) for name in names)


def test_steps_stay_on_disk_until_the_result_is_saved(job, real, tmp_path, monkeypatch):
    monkeypatch.setattr(evaluation, "rollout", run_of(step(0), step(1)))
    assert files_after(job, tmp_path / "saved") == [""]

    def full(*_):
        raise RecordingError("no room")

    monkeypatch.setattr("s2c2a.episodes.save_episodes", full)
    assert files_after(job, tmp_path / "full") == ["running-"]
    running = job.path(Cache(tmp_path / "full")).with_name(f"running-{job.file}")
    assert steps_in(running) == 2


@pytest.mark.parametrize("error", [S2C2AError("torn"), KeyboardInterrupt()])
@pytest.mark.parametrize(
    ("kept", "files"), [([], ["running-"]), ([0, 1], ["interrupted-"])]
)
def test_steps_of_an_interrupted_run_are_in_one_file(
    job, real, tmp_path, monkeypatch, error, kept, files
):
    run = run_of(step(0), step(1), error=error, kept=kept)
    monkeypatch.setattr(evaluation, "rollout", run)
    assert files_after(job, tmp_path) == files


def test_earlier_repetitions_of_an_interrupted_run_are_kept_too(
    job, real, tmp_path, monkeypatch
):
    run = run_of(step(0), step(1), error=S2C2AError("torn"), kept=[0, 1])
    monkeypatch.setattr(evaluation, "repeated_rollout", run)
    assert files_after(replace(job, repetitions=2), tmp_path) == ["interrupted-"]
    [path] = tmp_path.rglob("interrupted-*")
    assert len(load_episodes(path)[0]) == 2
