"""Recipes as files."""

import math
import re
from dataclasses import fields, replace
from pathlib import Path

import pytest

from s2c2a.errors import S2C2AError, StrategyError
from s2c2a.models import C2SOptions
from s2c2a.planning import BEST, Adam
from s2c2a.planning.terms import Evenness
from s2c2a.plugins.components import Component, CustomComponent
from s2c2a.strategies import RECIPES, load_recipe, recipe_from, save_recipe


@pytest.mark.parametrize("recipe", RECIPES.values(), ids=RECIPES)
def test_a_recipe_comes_back_from_its_file_under_the_name_of_the_file(recipe, tmp_path):
    again = load_recipe(save_recipe(recipe, tmp_path / "mine.toml"))
    assert again.name == "mine"
    assert again.training == recipe.training
    assert (again.planner, again.integral_gain, again.axis_weights) == (
        recipe.planner,
        recipe.integral_gain,
        recipe.axis_weights,
    )


def test_the_recipe_that_the_page_shows_is_one(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "concepts" / "recipe.md").read_text(
        encoding="utf-8"
    )
    (text,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    (tmp_path / "mine.toml").write_text(text)
    mine, best = load_recipe(tmp_path / "mine.toml"), RECIPES["best"]
    assert (mine.episodes, mine.c2s.hidden, mine.c2s_fit.max_epochs) == (40, 32, 30)
    assert (mine.c2a_fit, len(mine.planner.terms)) == (
        best.c2a_fit,
        len(best.planner.terms),
    )


def test_names_and_files_are_told_apart(tmp_path):
    assert recipe_from("best") is RECIPES["best"]
    assert (
        recipe_from(save_recipe(RECIPES["paper"], tmp_path / "mine.toml")).c2s
        == RECIPES["paper"].c2s
    )
    with pytest.raises(StrategyError, match="rename the file"):
        recipe_from(save_recipe(RECIPES["paper"], tmp_path / "best.toml"))
    with pytest.raises(StrategyError, match="choose one of best, best-long, paper"):
        recipe_from("worst")


LOCAL = 'model = "local"'


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("integral_gain =", "integral_gian =", "did you mean integral_gain"),
        ("depth =", "dept =", "dept: no such key; did you mean depth"),
        ("", "iteration = 3\n", "did you mean planner.solver.iterations"),
        ("", "max_epochs = 5\n", "no such key here, though another table has one"),
        ("", "no recipe", "mine.toml: not valid TOML"),
        ("iterations = 2", "iterations = 0", "iterations = 0 was given"),
        ("iterations = 2", "iterations = 'many'", "iterations"),
        ("integral_gain = 0.2", "integral_gain = nan", "integral_gain = nan was given"),
        ("[c2s]", "[c2s]\nneighbour = 3", r"  c2s\.neighbour: no such key"),
        (LOCAL, "", r"names no forward model.*such as model = 'chain'"),
        (
            LOCAL,
            'model = "soup"',
            "no model 'soup'; choose one of bilstm, chain, local",
        ),
        (LOCAL, 'model = "json:loads"', "is no model; derive it"),
        (LOCAL, 'model = "bilstm"', "layers"),
    ],
)
def test_a_file_that_is_no_recipe_is_refused(old, new, said, tmp_path):
    path = save_recipe(RECIPES["best"], tmp_path / "mine.toml")
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(StrategyError, match=said):
        load_recipe(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("episodes = 9", "c2s"),
        (
            "iteration = 5",
            r"iteration: no such key; did you mean planner.solver.iterations\?; \[c2s\]",
        ),
    ],
)
def test_a_file_without_a_forward_model_is_refused(text, said, tmp_path):
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(StrategyError, match=said):
        load_recipe(tmp_path / "mine.toml")


def test_a_file_that_is_missing_names_the_recipes(tmp_path):
    with pytest.raises(
        StrategyError,
        match=r"no recipe at .*; choose best, best-long, paper",
    ):
        recipe_from(tmp_path / "none.toml")


def test_a_recipe_based_on_another_holds_what_differs(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        'based_on = "best"\nintegral_gain = 0.1\n[planner]\nguides = []\nsolver = "Adam"\n'
        '[[planner.terms]]\nname = "Evenness"\nweight = 0.5\n[c2s]\nhidden = 32\n'
    )
    mine, best = load_recipe(path), RECIPES["best"]
    terms = tuple(
        Evenness(0.5) if term == Evenness() else term for term in best.planner.terms
    )
    assert mine.planner == replace(best.planner, guides=(), solver=Adam(), terms=terms)
    assert mine == replace(
        best,
        name="mine",
        integral_gain=0.1,
        c2s=replace(best.c2s, hidden=32),
        planner=mine.planner,
    )
    path.write_text('based_on = "worst"')
    with pytest.raises(StrategyError, match="no recipe 'worst'"):
        load_recipe(path)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("integral_gain", math.nan, "integral_gain = nan was given"),
        ("history_noise", math.inf, "history_noise = inf was given"),
        ("speeds", (0.02, math.inf), r"speeds = \(0\.02, inf\) was given"),
        ("axis_weights", (("hold-", math.nan),), "nan.* was given; give weights"),
        ("axis_weights", (("hold-", 1e30),), "was given; give weights"),
    ],
)
def test_a_number_that_is_not_finite_or_absurd_is_refused(key, value, said):
    with pytest.raises(S2C2AError, match=said):
        replace(RECIPES["best"], **{key: value})


def test_a_number_of_a_part_that_is_not_finite_is_refused():
    best = RECIPES["best"]
    with pytest.raises(S2C2AError, match="learning_rate = inf"):
        replace(best.c2s_fit, learning_rate=math.inf)
    with pytest.raises(S2C2AError, match="creep_times"):
        replace(best.c2s, creep_times=(math.nan,))
    with pytest.raises(S2C2AError, match="step = nan was given to mine:Solver"):
        CustomComponent("mine:Solver", {"step": math.nan})


def test_a_recipe_based_on_another_takes_nothing_of_its_forward_model_where_that_differs(
    tmp_path,
):
    path = tmp_path / "mine.toml"
    path.write_text(
        'based_on = "best"\n[c2s]\nmodel = "bilstm"\nlayers = 2\nhidden = 16\n'
    )
    assert load_recipe(path) == replace(
        RECIPES["best"], name="mine", c2s=C2SOptions(2, 16)
    )


BEST_PARTS = {
    "solver": type(BEST.solver),
    "terms": Evenness,
    "guides": type(BEST.guides[0]),
}


@pytest.mark.parametrize(("key", "base"), BEST_PARTS.items(), ids=BEST_PARTS)
def test_code_beside_a_recipe_is_found_from_any_folder(
    key, base, tmp_path, monkeypatch
):
    """In every table of the planner that can name a component."""
    folder = tmp_path / "recipes"
    folder.mkdir()
    name = f"own_{key}_beside"
    (folder / f"{name}.py").write_text(
        "from dataclasses import dataclass\n"
        f"from {base.__module__} import {base.__name__}\n\n\n"
        f"@dataclass(frozen=True)\nclass Mine({base.__name__}):\n    pass\n"
    )
    header = f"[[planner.{key}]]" if key in ("terms", "guides") else f"[planner.{key}]"
    (folder / "mine.toml").write_text(
        f'based_on = "best"\n{header}\nname = "{name}.py:Mine"\n'
    )
    monkeypatch.chdir(tmp_path)
    load_recipe(folder / "mine.toml").planner.build()


def test_every_table_of_the_planner_that_names_components_is_tried():
    holding = {
        field.name
        for field in fields(BEST)
        if isinstance(getattr(BEST, field.name), tuple | Component)
    }
    assert holding == BEST_PARTS.keys()
