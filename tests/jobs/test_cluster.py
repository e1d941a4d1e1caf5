"""A cluster of two local workers, one of which is killed during the work."""

import os
import signal
from concurrent.futures import CancelledError
from dataclasses import replace
from functools import partial
from pathlib import Path
from shutil import copy
from types import SimpleNamespace

import pytest
from distributed import Client, KilledWorker, LocalCluster

from s2c2a.arm import load_arm
from s2c2a.cli.execution import make_executor, require
from s2c2a.data import CollectOptions, collect
from s2c2a.episodes import load_episodes
from s2c2a.errors import ClusterError, S2C2AError, SimulationError
from s2c2a.execution.executors import Processes, Serial, in_order
from s2c2a.jobs import Cache, Run, jobs_for, make_all, score_rows, try_all
from s2c2a.jobs import cluster as cluster_module
from s2c2a.jobs.cluster import Cluster
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.tasks import load_waypoints, waypoints_task
from s2c2a.training import FitOptions

TWIN = load_arm("twin_arm")
SMALL = CollectOptions(episodes=8, samples=30, seed=3)


class Mortal(SimulatedRobot):
    """Takes its process with it in the middle of an episode, once."""

    def __init__(self, grave: Path, *given):
        super().__init__(*given)
        self._grave, self._left = grave, 15

    def send(self, action):
        self._left -= 1
        if self._left == 0 and not self._grave.exists():
            self._grave.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().send(action)


@pytest.fixture(scope="module")
def scheduler():
    """Of two workers, a process each, that come back when they are killed."""
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        dashboard_address="127.0.0.1:0",
        silence_logs=50,
    ) as workers:
        yield workers


@pytest.fixture
def cluster(scheduler):
    """The executor, as one that joins a running cluster."""
    scheduler.scale(2)  # dask gives up a killed worker that is slow to come back
    scheduler.wait_for_workers(2, timeout=60)
    with Cluster(scheduler.scheduler_address) as executor:
        yield executor


@pytest.fixture(scope="module")
def processes():
    """Two processes, as the command line takes them."""
    with Processes(2) as executor:
        yield executor


@pytest.fixture(scope="module")
def short_task(tmp_path_factory):
    """A second of waypoints."""
    path = tmp_path_factory.mktemp("task") / "short.csv"
    path.write_text("time,x,y,z\n0,0,0,0.6\n1,0.05,0,0.595\n", encoding="utf-8")
    return waypoints_task("short", load_waypoints(path), TWIN)


@pytest.fixture(scope="module")
def quick_recipe(tiny_recipe):
    """Trained for two epochs: how well does not matter here."""
    fit = FitOptions(max_epochs=2, epochs_per_call=2)
    return replace(tiny_recipe, c2s_fit=fit, c2a_fit=fit, integral_gain=0.2)


@pytest.fixture(scope="module")
def jobs(short_task, quick_recipe):
    """Two strategies on a short task."""
    return jobs_for([short_task], TWIN, ("pcc", "s2c2a"), [0], quick_recipe)


@pytest.fixture(scope="module")
def made_here(jobs, processes, tmp_path_factory):
    """The jobs by processes of this machine: where they are kept, and their rows."""
    folder = tmp_path_factory.mktemp("here")
    cache = Cache(folder / "data", folder / "runs")
    return SimpleNamespace(
        cache=cache, rows=score_rows("mine", make_all(jobs, cache, processes))
    )


def contents(folder: Path) -> dict[str, bytes]:
    """Every array of every run but how long it took."""
    return {
        f"{path.name}: {column}": values.tobytes()
        for path in folder.iterdir()
        for column, values in load_episodes(path)[0][0].columns.items()
        if column != "tick_time"
    }


def test_a_recording_is_identical_after_a_worker_was_killed(cluster, tmp_path):
    def gather(name, robot, executor):
        collect(tmp_path / name, TWIN, robot, SMALL, executor=executor)
        return (tmp_path / name).read_bytes()

    there = gather(
        "there.episodes", partial(Mortal, tmp_path / "grave", TWIN, "fast"), cluster
    )
    assert (tmp_path / "grave").exists()
    assert there == gather(
        "here.episodes", partial(SimulatedRobot, TWIN, "fast"), Serial()
    )


@pytest.mark.slow
def test_runs_are_identical_after_a_worker_was_killed(
    made_here, jobs, cluster, scheduler, tmp_path
):
    with Client(scheduler.scheduler_address, set_as_default=False) as client:
        workers = list(client.run(os.getpid).values())
    told = []

    def kill_one(doing, done, total):
        told.append((doing, done, total))
        if "runs" in doing and done == 1:
            os.kill(workers[0], signal.SIGKILL)

    cache = Cache(tmp_path / "data", tmp_path / "runs")
    (recording,) = made_here.cache.folder.glob("*.episodes")
    cache.folder.mkdir()
    copy(recording, cache.folder)
    assert (
        score_rows("mine", make_all(jobs, cache, cluster, kill_one)) == made_here.rows
    )
    assert told[-1] == ("making runs", 2, 2)
    assert contents(cache.runs) == contents(made_here.cache.runs)
    for path in recording.parent.glob("*.safetensors"):
        assert (cache.folder / path.name).read_bytes() == path.read_bytes()


@pytest.mark.slow
def test_a_failed_job_does_not_affect_others(
    made_here, quick_recipe, short_task, processes, tmp_path
):
    broken = replace(quick_recipe, c2s_fit=FitOptions(batch_size=10**6))
    jobs = [
        job
        for recipe in (broken, quick_recipe)
        for job in jobs_for([short_task], TWIN, ["s2c2a"], [0], recipe)
    ]
    cache = replace(made_here.cache, runs_in=tmp_path)
    error, run = try_all(jobs, cache, processes)
    assert isinstance(error, S2C2AError)
    assert "fewer than one batch" in str(error)
    assert isinstance(run, Run)
    assert len(list(tmp_path.glob("*.episodes"))) == 1
    with pytest.raises(
        S2C2AError,
        match=r"1 of 2 runs failed, such as s2c2a on short .*: .*fewer than one",
    ):
        make_all(jobs, cache, processes)
    with pytest.raises(S2C2AError, match=r"fewer than one.* \(s2c2a on short"):
        make_all(jobs[:1], cache, processes)


def test_workers_with_other_versions_are_rejected(scheduler, monkeypatch):
    monkeypatch.setattr(cluster_module, "_own_versions", lambda: {"s2c2a": "9.9.9"})
    with pytest.raises(
        ClusterError,
        match=r"the worker tcp://\S+ of \S+ has s2c2a \S+ \(here 9\.9\.9\); install the same",
    ):
        Cluster(scheduler.scheduler_address)


@pytest.mark.slow
def test_a_late_worker_with_another_version_is_rejected(cluster, monkeypatch):
    monkeypatch.setattr(cluster, "_versions", {"s2c2a": "9.9.9"})
    with pytest.raises(
        ClusterError, match=r"joined that has s2c2a .* \(here 9\.9\.9\)"
    ):
        next(in_order(cluster, abs, [1]))


@pytest.mark.slow
def test_an_error_on_a_worker_is_raised_here(cluster):
    with pytest.raises(SimulationError, match="blew up") as raised:
        next(in_order(cluster, blow_up, [1]))
    assert raised.value.step == 5


def blow_up(number):
    raise SimulationError("blew up", 5)


def test_an_invalid_address_is_rejected(monkeypatch):
    with pytest.raises(
        ClusterError, match="no cluster 'nowhere'; give the address of a scheduler"
    ):
        Cluster("nowhere")
    monkeypatch.setattr(cluster_module, "PATIENCE", 0.5)
    with pytest.raises(
        ClusterError,
        match=r"no scheduler answers at tcp://127\.0\.0\.1:9 .*start `dask scheduler`",
    ):
        Cluster("tcp://127.0.0.1:9")
    with pytest.raises(ClusterError, match=r"no scheduler answers at gone\.json"):
        Cluster("gone.json")


def test_a_worker_count_is_for_this_machine_only():
    with pytest.raises(S2C2AError, match="--jobs 3 was given, but the workers"):
        make_executor(3, "tcp://127.0.0.1:9")


def test_a_missing_extra_raises_with_the_install_command():
    with pytest.raises(S2C2AError, match=r'pip install "\.\[ros\]"'):
        require("ros", "no_such_package")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "message"),
    [
        (KilledWorker("job", None, allowed_failures=3), "were killed by one job"),
        (CancelledError(), "is gone; repeat the command: finished results"),
    ],
)
def test_errors_of_the_cluster_become_cluster_errors(error, message, scheduler):
    with (
        pytest.raises(ClusterError, match=message),
        Cluster(scheduler.scheduler_address),
    ):
        raise error
