"""Artifacts are made once, found by all their inputs, and made again if damaged."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.data import CollectOptions
from s2c2a.errors import S2C2AError, TargetError
from s2c2a.goals import Goal
from s2c2a.jobs import (
    Cache,
    Conditions,
    NetworksArtifact,
    RecordingArtifact,
    jobs_for,
    made,
    make_all,
)
from s2c2a.robots import RobotFactory
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a.tasks import Score, Task

TWIN = load_arm("twin_arm")
SMALL = RecordingArtifact(TWIN, CollectOptions(episodes=2, samples=20))
PAPER = recipe_named("paper")


@pytest.fixture
def cache(tmp_path):
    return Cache(tmp_path / "data", tmp_path / "runs")


def test_a_recording_is_collected_once_and_replaced_if_it_is_damaged(cache):
    first, path, told = made(SMALL, cache), SMALL.path(cache), []
    written = path.stat().st_mtime_ns
    second = made(SMALL, cache, lambda *what: told.append(what))
    assert (told, path.stat().st_mtime_ns) == ([], written)
    path.write_bytes(path.read_bytes()[:700])
    for again in (second, made(SMALL, cache)):
        np.testing.assert_array_equal(first.actions, again.actions)


def test_the_path_of_networks_depends_on_all_training_inputs(cache):
    networks = NetworksArtifact(TWIN, PAPER, 0)
    same = replace(PAPER, integral_gain=0.3)
    assert replace(networks, recipe=same).path(cache) == networks.path(cache)
    different = [
        replace(networks, recipe=replace(PAPER, history_noise=0.1)),
        replace(networks, recipe=replace(PAPER, speeds=(0.03, 0.2))),
        replace(networks, recipe=replace(PAPER, babbling="motor")),
        replace(networks, seed=1),
        replace(networks, arm=load_arm("twin_creep")),
    ]
    assert len({one.path(cache) for one in [networks, *different]}) == 6


@pytest.mark.parametrize("name", ["twin_arm", "simulated_arm"])
@pytest.mark.parametrize("recipe", ["best", "paper"])
def test_networks_of_a_recipe_are_those_of_its_runs(name, recipe):
    arm, chosen = load_arm(name), recipe_named(recipe)
    (job,) = jobs_for(["circle"], arm, ["s2c2a"], [3], chosen)
    assert job.needs == (NetworksArtifact.of_recipe(arm, chosen, 3),)


@pytest.fixture
def waypoints(tmp_path):
    """A task of a second."""
    path = tmp_path / "short.csv"
    path.write_text("time,x,y,z\n0,0,0,0.6\n1,0.05,0,0.595\n", encoding="utf-8")
    return path


def pcc_job(waypoints, **changes):
    (job,) = jobs_for([str(waypoints)], TWIN, ["pcc"], [3], PAPER)
    return replace(job, **changes)


def test_a_finished_run_is_loaded_and_a_damaged_one_made_again(waypoints, cache):
    told, job = [], pcc_job(waypoints)
    (first,) = make_all([job], cache)
    (loaded,) = make_all([job], cache, progress=lambda *what: told.append(what))
    assert told == []
    job.path(cache).write_bytes(job.path(cache).read_bytes()[:100])
    (again,) = make_all([job], cache)
    for run in (loaded, again):
        assert (run.strategy, run.seed, run.task) == ("pcc", 3, "short")
        assert [one.value for one in run.scores] == [one.value for one in first.scores]
        np.testing.assert_array_equal(
            run.episode.after("states"), first.episode.after("states")
        )


def test_the_path_of_a_run_depends_on_all_its_inputs(waypoints, cache):
    job = pcc_job(waypoints)
    waypoints.write_text("time,x,y,z\n0,0,0,0.6\n1,0.06,0,0.595\n", encoding="utf-8")
    others = [
        pcc_job(waypoints),
        replace(job, seed=1),
        replace(job, strategy="pcc-fitted"),
        replace(job, recipe=replace(PAPER, integral_gain=0.3)),
        replace(job, conditions=Conditions(RobotFactory.simulation(payload=0.05))),
        replace(job, conditions=Conditions(run=RunOptions("arm"))),
    ]
    assert len({one.path(cache) for one in [job, *others]}) == 7
    assert replace(job).path(cache) == job.path(cache)


@pytest.mark.parametrize(
    ("score", "said"),
    [
        (Score("positoin"), "positoin"),
        (Score("position", module=3), "module 3"),
        (Score("tilt", steps=[True]), "steps"),
    ],
)
def test_a_task_without_targets_for_its_scores_is_rejected_before_a_run(
    twin, score, said
):
    task = Task("mine", (Goal.of(3),) * 4, (score,))
    with pytest.raises(TargetError, match=said):
        jobs_for([task], twin, ["pcc"], [0], recipe_named("best"))


def test_invalid_jobs_are_rejected_before_anything_is_made(waypoints, cache):
    with pytest.raises(
        S2C2AError, match=r"no strategy 'magic'; choose one of .*pcc-fitted"
    ):
        jobs_for(["circle"], TWIN, ["magic"], [0], PAPER)
    for conditions, said in (
        (Conditions(RobotFactory("walker")), "no robot 'walker'"),
        (Conditions(RobotFactory.simulation(payload=-1)), "payload"),
    ):
        with pytest.raises(S2C2AError, match=said):
            make_all(
                [pcc_job(waypoints, strategy="s2c2a", conditions=conditions)], cache
            )
    assert not cache.folder.exists()
