"""What `run` says about waypoints before the arm moves."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

import s2c2a
from s2c2a.arm import load_arm, randomized_arm
from s2c2a.cli.run import _describe_reach, _reach_model
from s2c2a.models.forward_model import ForwardModel, PCCForwardModel
from s2c2a.planning.reach import Reachability
from s2c2a.strategies import TrainedNetworks, recipe_named, save_networks
from s2c2a.strategies.pcc import GAINS, FittedGains
from s2c2a.tasks import Task, load_task, paced_task, to_point
from s2c2a.tasks.projection import projected
from s2c2a.tasks.remarks import remarks
from s2c2a.tasks.scenes import Box, HalfSpace, Scene, Sphere, load_scene
from s2c2a.training import Trained

TWIN = load_arm("twin_arm")
FINGER = load_arm("planar_finger")
ARCS = PCCForwardModel.of(TWIN)


def written(tmp_path, *rows):
    path = tmp_path / "path.csv"
    path.write_text("\n".join(["time,x,y,z", *rows]), encoding="utf-8")
    return str(path)


def remarked(task, arm=TWIN, by_arcs=True):
    return "\n".join(remarks(load_task(task, arm), arm, by_arcs))


def test_waypoints_behind_the_base_are_explained(tmp_path):
    path = written(tmp_path, "0,0,0,-0.6", "4,0.1,0,-0.5")
    said = remarked(path)
    assert "out of reach by up to " in said
    assert "of the tip at 0.1 to 4 s" in said
    assert "z grows from the base toward the tip" in said
    said = remarked(path, by_arcs=False)
    assert "out of reach" not in said  # the model says it for targets
    assert "z grows from the base toward the tip" in said


def test_reachable_waypoints_are_silent(tmp_path):
    assert remarked(written(tmp_path, "0,0,0,0.6", "4,0.1,0,0.58")) == ""


def test_a_pace_in_the_name_reports_the_same_at_other_times(tmp_path):
    path = written(tmp_path, "0,0,0,-0.6", "4,0.9,0,0.5")
    one, slower = (remarked(name) for name in (path, f"{path}@0.5"))
    assert "of the tip at 0.1 to 4 s" in one
    assert "of the tip at 0.1 to 8 s" in slower


def test_many_targets_out_of_reach_take_one_line(tmp_path):
    rows = [f"{x / 10},{0.9 if x in (3, 4, 5, 8) else 0},0,0.6" for x in range(1, 10)]
    said = remarked(written(tmp_path, *rows))
    assert said.count("\n") == 0
    assert said.endswith("of the tip at 0.3 to 0.5, 0.8 s")


@pytest.mark.parametrize("seed", range(2))
def test_times_in_milliseconds_are_remarkable(tmp_path, seed):
    slow = TWIN.model_copy(update={"control_rate": 0.1})
    arm = randomized_arm(slow, seed, 1.0)
    path = written(tmp_path, "1000,0,0,0.6", "20000,0,0,0.59")
    assert "takes 5.6 hours; columns of times are in seconds" in remarked(path, arm)


@pytest.mark.parametrize(
    ("solid", "words"),
    [
        (Sphere(center=(0, 0, -0.3), radius=0.05), "obstacle 0 .* beyond the arm"),
        (Sphere(center=(2, 0, 0.3), radius=0.05), "obstacle 0 .* beyond the arm"),
        (Sphere(center=(0, 0, 0.6), radius=0.05), "obstacle 0 .* tip is at rest"),
        (HalfSpace(point=(0, 0, 0.5), normal=(0, 0, -1)), "tip is at rest"),
        (Sphere(center=(2, 0, 0.3), radius=0.05, velocity=(-0.3, 0, 0)), None),
        (Sphere(center=(0, 0, 0.6), radius=0.05, appears=3.0), None),
        (HalfSpace(point=(0, 0, -0.05), normal=(0, 0, 1)), None),
        (Box(center=(0, 0, -0.02), size=(1, 1, 0.04)), None),
    ],
)
def test_an_obstacle_at_the_arm_or_far_from_all_shapes_is_remarkable(solid, words):
    for arm in (TWIN, randomized_arm(TWIN, 4, 1.0)):
        task = Scene(obstacles=(solid,)).around(to_point(arm, (0.2, 0, 0.5)), arm)
        said = "; ".join(remarks(task, arm, by_arcs=False))
        assert re.search(words, said) if words else not said


def test_obstacles_have_the_numbers_of_their_tables_in_the_scene(tmp_path):
    pytest.importorskip("trimesh").creation.box((0.1,) * 3).export(tmp_path / "box.stl")
    near = 'kind = "sphere"\ncenter = [0.3, 0, 0.4]\nradius = 0.05'
    texts = [
        f"{near}\nappears = 500",
        'kind = "mesh"\nfile = "box.stl"\nposition = [0, 0.3, 0.3]',
        near,
        'kind = "mesh"\nfile = "box.stl"\nposition = [2, 0, 0.3]',
        'kind = "sphere"\ncenter = [0, 0, 0.6]\nradius = 0.05',
    ]
    path = tmp_path / "scene.toml"
    path.write_text("".join(f"[[obstacles]]\n{text}\n" for text in texts))
    scene = load_scene(path)
    for obstacles in ((), ([[0.2, 0, 0.3], [3, 0, 0]], [0.01, 0.1])):
        goal = to_point(TWIN, (0.2, 0, 0.5)).goals[0]
        own = Task("own", (goal.with_obstacles(*obstacles),) if obstacles else (goal,))
        said = [
            text.split(" is ")[0] for text in remarks(scene.around(own, TWIN), TWIN)
        ]
        of_scene = [f"obstacle {n} of the scene (counted from 0)" for n in (3, 4)]
        assert said == ["obstacle 1 (counted from 0)"] * bool(obstacles) + of_scene
        assert said[:-2] == [text.split(" is ")[0] for text in remarks(own, TWIN)]


def test_a_run_of_a_program_warns_of_a_target_out_of_reach(twin, monkeypatch):
    faulty = SimpleNamespace(options={"faults": ["'cables' was lost"]}, columns={})
    faulty.columns["stage"] = np.zeros(1)
    monkeypatch.setattr("s2c2a.evaluation.rollout", lambda *_: faulty)
    with (
        pytest.warns(UserWarning, match="out of reach by up to 24.14 cm"),
        pytest.warns(UserWarning, match="because of faults .'cables' was lost"),
    ):
        s2c2a.run(SimpleNamespace(arm=twin), None, to_point(twin, (0.7, 0, 0.2)))


def test_targets_that_a_model_does_not_reach_are_said_with_their_times(tmp_path):
    rows = ["0,0,0,0.6", "4,0.1,0,0.58", "8,0.5,0,0.58", "10,0.5,0,0.58"]
    task = paced_task(written(tmp_path, *rows), TWIN, 1.0)
    reachability = Reachability(TWIN, ARCS, 0.0, "tip")
    found = projected(task, TWIN.length, reachability)
    said = _describe_reach(found, TWIN, moves=False)
    assert "steps are out of reach, by up to " in said
    assert said.endswith("to 10 s")
    assert "moved" not in said
    assert "moved to the nearest shapes" in _describe_reach(found, TWIN, moves=True)
    circle = projected(load_task("circle", TWIN), TWIN.length, reachability)
    assert _describe_reach(circle, TWIN, moves=False) == "all targets are within reach"


def test_a_model_is_asked_where_weights_hold_one_and_the_task_is_no_named_one(
    tmp_path, capsys
):
    def saved(arm):
        path = tmp_path / f"{arm.name}.safetensors"
        gains = Trained(FittedGains(jnp.ones(arm.module_count)))
        networks = TrainedNetworks(arm, recipe_named("best"), 0, {GAINS: gains})
        save_networks(replace(networks, strategy="pcc-fitted"), path)
        return path

    assert _reach_model("way.csv", TWIN, saved(TWIN), "", False, 0.05) is None
    assert capsys.readouterr().out == ""
    # named tasks are made for arms that bend every way, and fingers do not
    for task, arm, projects in (("way.csv", TWIN, True), ("circle", FINGER, False)):
        arcs = _reach_model(task, arm, saved(arm), "", projects, 0.0)
        assert isinstance(arcs, PCCForwardModel)
        assert "has no model, modules bend" in capsys.readouterr().out
    shipped = Path("shipped")
    for task in ("way.csv", "own.py:task", None):
        model = _reach_model(task, TWIN, shipped, "", False, 0.05)
        assert isinstance(model, ForwardModel)
    for task in ("circle", "square@0.5"):
        assert _reach_model(task, TWIN, shipped, "", False, 0.0) is None
    assert _reach_model("way.csv", TWIN, None, "", False, 0.0) is None
