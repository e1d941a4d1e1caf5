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
from s2c2a.kinematics import states_from_configurations
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import Goal, Planner
from s2c2a.strategies import load_recipe, recipe_named, save_recipe

from marks import slow_after

EXTENDING = Path(__file__).parents[2] / "examples" / "extending"
OWN = (EXTENDING / "own_term.toml", EXTENDING / "own_solver.toml")
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
    options = json.loads(Path("out/options.json").read_text())["options"]
    assert name in json.dumps(options["recipe"])


def plan_steps(options, goal, steps=40):
    """States of an arm that executes its plan exactly."""
    planner = Planner(TWIN, PCCForwardModel.of(TWIN), options)
    plan = planner.start(Estimate(STRAIGHT))
    for _ in range(steps):
        plan = planner.plan(plan, Estimate(plan.configurations), goal)
    lengths = PCCForwardModel.of(TWIN).lengths
    return np.asarray(states_from_configurations(plan.configurations, lengths))


@pytest.mark.slow
def test_the_term_keeps_the_elbow_high_and_the_solver_reaches_the_target():
    goal = Goal.of(3).with_position([0.3, 0.0, 0.42])
    recipes = (recipe_named("best"), *map(load_recipe, OWN))
    before, with_term, with_solver = [
        plan_steps(each.planner, goal) for each in recipes
    ]
    assert with_term[1, 2] > before[1, 2] + 0.01
    assert np.linalg.norm(with_solver[-1, :3] - [0.3, 0.0, 0.42]) < 0.01


def test_a_recipe_with_custom_components_round_trips(tmp_path):
    recipe = load_recipe(EXTENDING / "own_term.toml")
    assert recipe.training == recipe_named("best").training
    assert recipe.planner.terms[:-1] == recipe_named("best").planner.terms
    again = load_recipe(save_recipe(recipe, tmp_path / "again.toml"))
    assert again.planner == recipe.planner


ELBOW = "own_term.py:ElbowHigh"
RECIPE = 'based_on = "best"\n[[planner.terms]]\nname = "{}"\n{}'


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("nowhere.py:Thing", "", "no file"),
        ("Evennes", "", r"no term 'Evennes' \(did you mean Evenness\?\); choose one"),
        (ELBOW, "parameters = { hight = 0.3 }", "cannot be built from .*hight"),
        (ELBOW, "parameters = { height = nan }", "height = nan was given to "),
        (ELBOW, "parameters = { height = -1.0 }", "height = -1.0 was given"),
        (ELBOW, "height = 0.3", "height"),
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
