"""A custom cost term and a custom solver, from the command line and from Python."""

import json
from pathlib import Path
from textwrap import indent

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.cli.main import main
from s2c2a.errors import S2C2AError
from s2c2a.estimation import Estimate
from s2c2a.kinematics import bends_from_configurations, states_from_configurations
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import Goal, Planner
from s2c2a.strategies import (
    load_recipe,
    recipe_named,
    save_recipe,
)

from marks import slow_after

EXTENDING = Path(__file__).parents[2] / "examples" / "extending"
TWIN = load_arm("twin_arm")
STRAIGHT = np.tile([0.0, 0.0, 1.0], (3, 1))


@pytest.mark.parametrize(
    ("example", "name"),
    slow_after(1, [("own_term", "ElbowHigh"), ("own_solver", "Descent")]),
)
def test_an_example_runs_from_the_command_line(example, name, tmp_path, monkeypatch):
    text, recipe_text = (
        (EXTENDING / f"{example}.{ending}").read_text() for ending in ("py", "toml")
    )
    assert indent(recipe_text, "    ") in text
    monkeypatch.chdir(tmp_path)
    waypoints, recipe = tmp_path / "short.csv", EXTENDING / f"{example}.toml"
    waypoints.write_text("time,x,y,z\n0.5,0.05,0.0,0.59\n1.5,0.1,0.05,0.57\n")
    main(f"run {waypoints} --strategy pcc --recipe {recipe} --out out".split())
    rows = json.loads(Path("out/results.json").read_text())
    assert rows[0]["mean"] < 6.0
    assert name in json.dumps(
        json.loads(Path("out/options.json").read_text())["options"]["recipe"]
    )


def plan_steps(options, goal, steps=40):
    """Bends and states of an arm that executes its plan exactly."""
    planner = Planner(TWIN, PCCForwardModel.of(TWIN), options)
    plan = planner.start(Estimate(STRAIGHT))
    for _ in range(steps):
        plan = planner.plan(plan, Estimate(plan.configurations), goal)
    states = states_from_configurations(
        plan.configurations, PCCForwardModel.of(TWIN).lengths
    )
    return np.asarray(bends_from_configurations(plan.configurations)), np.asarray(
        states
    )


@pytest.mark.slow
def test_the_term_keeps_the_elbow_high_and_the_solver_reaches_the_target():
    goal, best = (
        Goal.of(3).with_position([0.3, 0.0, 0.42]),
        recipe_named("best").planner,
    )
    before = plan_steps(best, goal)[1]
    with_term = plan_steps(load_recipe(EXTENDING / "own_term.toml").planner, goal)[1]
    assert with_term[1, 2] > before[1, 2] + 0.01
    with_solver = plan_steps(load_recipe(EXTENDING / "own_solver.toml").planner, goal)[
        1
    ]
    assert np.linalg.norm(with_solver[-1, :3] - [0.3, 0.0, 0.42]) < 0.01


def test_a_recipe_with_custom_components_round_trips(tmp_path):
    recipe = load_recipe(EXTENDING / "own_term.toml")
    assert recipe.training == recipe_named("best").training
    assert recipe.planner.terms[:-1] == recipe_named("best").planner.terms
    assert (
        load_recipe(save_recipe(recipe, tmp_path / "again.toml")).planner
        == recipe.planner
    )


RECIPE = 'based_on = "best"\n[[planner.terms]]\nname = "{}"\n{}'


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("nowhere.py:Thing", "", "no file"),
        (
            "Evennes",
            "",
            r"no term 'Evennes' \(did you mean Evenness\?\); choose one of",
        ),
        (
            "own_term.py:ElbowHigh",
            "parameters = { hight = 0.3 }",
            "cannot be built from .*hight",
        ),
        (
            "own_term.py:ElbowHigh",
            "parameters = { height = nan }",
            "height = nan was given to ",
        ),
        (
            "own_term.py:ElbowHigh",
            "parameters = { height = -1.0 }",
            "height = -1.0 was given",
        ),
        ("own_term.py:ElbowHigh", "height = 0.3", "height"),
        ("own_solver.py:Descent", "", "is no term"),
        ("Evenness", "wieght = 0.3", "wieght"),
        ("Evenness", "weight = nan", "weight = nan was given"),
    ],
)
def test_invalid_components_are_rejected_when_the_recipe_is_read(
    name, parameters, message, tmp_path
):
    for file in EXTENDING.glob("*.py"):
        (tmp_path / f"{file.stem}.py").symlink_to(file)
    (tmp_path / "mine.toml").write_text(RECIPE.format(name, parameters))
    with pytest.raises(S2C2AError, match=message):
        load_recipe(tmp_path / "mine.toml")
