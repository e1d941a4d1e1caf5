"""What `run` says about waypoints before the arm moves."""

from dataclasses import replace
from pathlib import Path

import jax.numpy as jnp
import pytest

from s2c2a.arm import load_arm
from s2c2a.cli.run import _describe_reach, _reach_model, _report_waypoints
from s2c2a.models.forward_model import ForwardModel, PCCForwardModel
from s2c2a.planning.reach import Reachability
from s2c2a.strategies import TrainedNetworks, recipe_named, save_networks
from s2c2a.strategies.pcc import GAINS, FittedGains
from s2c2a.tasks import load_task, paced_task
from s2c2a.tasks.projection import projected
from s2c2a.training import Trained

TWIN = load_arm("twin_arm")
FINGER = load_arm("planar_finger")
ARCS = PCCForwardModel.of(TWIN)


def written(tmp_path, *rows):
    path = tmp_path / "path.csv"
    path.write_text("\n".join(["time,x,y,z", *rows]), encoding="utf-8")
    return str(path)


def reported(capsys, task, model=None):
    _report_waypoints(task, TWIN, model)
    return capsys.readouterr().out


def test_waypoints_behind_the_base_are_explained(tmp_path, capsys):
    path = written(tmp_path, "0,0,0,-0.6", "4,0.1,0,-0.5")
    printed = reported(capsys, path)
    assert "out of reach by up to " in printed
    assert "of the tip" in printed
    assert "(2 of 2)" in printed
    assert "z grows from the base toward the tip" in printed
    printed = reported(capsys, path, ARCS)
    assert "out of reach" not in printed  # the model says it for targets
    assert "z grows from the base toward the tip" in printed


def test_reachable_waypoints_are_silent(tmp_path, capsys):
    path = written(tmp_path, "0,0,0,0.6", "4,0.1,0,0.58")
    assert reported(capsys, path) == ""


def test_a_pace_in_the_name_reports_the_same(tmp_path, capsys):
    path = written(tmp_path, "0,0,0,-0.6", "4,0.9,0,0.5")
    without = reported(capsys, path)
    assert without
    assert reported(capsys, f"{path}@0.5") == without


@pytest.mark.slow
def test_many_waypoints_out_of_reach_take_one_line(tmp_path, capsys):
    far = {3, 4, 5, 8, 11, 12}
    rows = [f"{time},{0.9 if time in far else 0},0,0.6" for time in range(14)]
    printed = reported(capsys, written(tmp_path, *rows))
    assert printed.count("\n") == 1
    assert "out of reach by up to " in printed
    assert "of the tip" in printed
    assert "(6 of 14)" in printed
    assert "3 to 5, 8, 11 to 12 s" in printed


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
