"""Recipes as files."""

import pytest

from s2c2a.errors import StrategyError
from s2c2a.strategies import RECIPES, load_recipe, recipe_from, save_recipe


@pytest.mark.parametrize("recipe", RECIPES.values(), ids=RECIPES)
def test_a_recipe_comes_back_from_its_file_under_the_name_of_the_file(recipe, tmp_path):
    again = load_recipe(save_recipe(recipe, tmp_path / "mine.toml"))
    assert again.name == "mine"
    assert again.training == recipe.training
    assert (again.planner, again.correction, again.axis_weights) == (
        recipe.planner,
        recipe.correction,
        recipe.axis_weights,
    )


def test_names_and_files_are_told_apart(tmp_path):
    assert recipe_from("best") is RECIPES["best"]
    assert recipe_from(save_recipe(RECIPES["paper"], tmp_path / "mine.toml")).c2s == RECIPES["paper"].c2s
    with pytest.raises(StrategyError, match="a name of its own"):
        recipe_from(save_recipe(RECIPES["paper"], tmp_path / "best.toml"))
    with pytest.raises(StrategyError, match="choose one of best, paper"):
        recipe_from("worst")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace("correction =", "corection ="), "belong to none"),
        (lambda text: text.replace("depth =", "dept ="), "belong to none"),
        (lambda text: text.replace("iterations = 20", "iterations = 0"), "0 iterations"),
        (lambda text: text.replace("iterations = 20", "iterations = 'many'"), "iterations"),
        (lambda text: text[: text.index("[c2s]")], "c2s"),
        (lambda text: "no recipe", "holds no recipe"),
    ],
)
def test_a_file_that_is_no_recipe_is_refused(change, said, tmp_path):
    path = save_recipe(RECIPES["best"], tmp_path / "mine.toml")
    path.write_text(change(path.read_text()))
    with pytest.raises(StrategyError, match=said):
        load_recipe(path)


def test_a_file_that_is_missing_names_the_recipes(tmp_path):
    with pytest.raises(StrategyError, match=r"no recipe at .*; take best, paper"):
        recipe_from(tmp_path / "none.toml")
