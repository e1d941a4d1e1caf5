"""A custom forward model, from data to a run, through the command line."""

from pathlib import Path

import pytest
import tomli_w

from s2c2a.cli.main import main
from s2c2a.errors import StrategyError
from s2c2a.models.registry import MODELS
from s2c2a.strategies import load_networks, load_recipe, save_recipe

EXAMPLE = Path(__file__).parents[2] / "examples" / "extending" / "own_model.py"
MODEL = f"{EXAMPLE}:ArcsOptions"
FIT = {"learning_rate": 1e-2, "max_epochs": 4, "epochs_per_call": 4}
SOLVER = {"learning_rate": 0.02, "iterations": 3}


@pytest.fixture(scope="module")
def recipe(tmp_path_factory) -> Path:
    """A recipe with the model of the example, small and quick."""
    table = {"based_on": "paper", "planner": {"solver": SOLVER}}
    table |= {"c2s": {"model": MODEL, "hidden": 4}, "c2a": {"layers": 1, "hidden": 4}}
    table |= {"c2s_fit": FIT, "c2a_fit": FIT}
    path = tmp_path_factory.mktemp("own") / "own.toml"
    path.write_text(tomli_w.dumps(table))
    return path


@pytest.fixture(scope="module")
def strategy(recipe) -> Path:
    """Strategy file of a recording and a training with this model."""
    data, file = recipe.with_name("data.episodes"), recipe.with_name("own.safetensors")
    main(f"collect --episodes 2 --samples 60 --recipe {recipe} --out {data}".split())
    main(["train", str(data), "--recipe", str(recipe), "--out", str(file)])
    return file


@pytest.mark.slow
def test_a_custom_model_runs_a_task(strategy, aside, run_errors, capsys):
    assert run_errors(aside, "--weights", strategy, "--trust", MODEL)
    assert "of the arm's length" in capsys.readouterr().out


@pytest.mark.slow
def test_its_options_round_trip_through_recipe_and_strategy_file(
    recipe, strategy, tmp_path
):
    mine = MODELS.named(MODEL)
    networks = load_networks(strategy)
    assert type(networks.recipe.c2s) is type(load_recipe(recipe).c2s) is mine
    assert networks.recipe.c2s.hidden == 4
    assert networks.c2s.network.layers[0].weight.shape == (4, 6)
    again = load_recipe(save_recipe(load_recipe(recipe), tmp_path / "again.toml"))
    assert again.training == load_recipe(recipe).training


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hidden": "many"}, "hidden"),
        ({"layers": 2}, "layers"),
        ({"model": f"{EXAMPLE}:Nothing"}, "Nothing"),
    ],
)
def test_invalid_options_are_rejected(recipe, tmp_path, change, message):
    table = {"c2s": {"model": MODEL} | change, "c2a": {"layers": 1, "hidden": 4}}
    (tmp_path / "wrong.toml").write_text(tomli_w.dumps(table))
    with pytest.raises(StrategyError, match=message):
        load_recipe(tmp_path / "wrong.toml")
