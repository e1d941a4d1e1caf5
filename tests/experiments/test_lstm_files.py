"""Files of the LSTM: round trips, arms and strategies that they are not of, and damage."""

import jax
import numpy as np
import pytest

from s2c2a.errors import StrategyError
from s2c2a.strategies import (
    TrainedNetworks,
    labeled,
    load_networks,
    recipe_named,
    save_networks,
)
from s2c2a.training import FitOptions, Trained
from s2c2a_experiments.lstm import LSTMComparison
from s2c2a_experiments.tip_lstm import LSTMOptions


@pytest.fixture(scope="module")
def trained(twin):
    """An LSTM as it begins, with the numbers of a training."""
    options = LSTMOptions(2, 8, FitOptions(max_epochs=5), 0.1)
    network = options.untrained(twin, jax.random.key(3))
    curve = np.array([[1.0, 0.5, 0.6], [2.0, 0.3, 0.4]])
    networks = TrainedNetworks(
        twin,
        recipe_named("paper"),
        3,
        {"LSTM": Trained(network, curve, (3.0, 2.0))},
    )
    return labeled(networks, LSTMComparison(options))


@pytest.fixture(scope="module")
def file(trained, tmp_path_factory):
    path = tmp_path_factory.mktemp("lstm") / "deep" / "twin.safetensors"
    save_networks(trained, path)
    return path


def test_everything_comes_back(file, trained):
    loaded = load_networks(file)
    assert (loaded.arm, loaded.recipe, loaded.seed) == (
        trained.arm,
        trained.recipe,
        trained.seed,
    )
    assert loaded.trained["LSTM"].percent == trained.trained["LSTM"].percent
    np.testing.assert_array_equal(
        loaded.trained["LSTM"].curve, trained.trained["LSTM"].curve
    )
    before, after = (jax.tree.leaves(one.networks) for one in (trained, loaded))
    for one, two in zip(before, after, strict=True):
        np.testing.assert_array_equal(one, two)


def test_a_file_names_the_strategy_that_it_belongs_to(file, strategy_file):
    assert load_networks(file).strategy == "lstm"
    assert load_networks(strategy_file).strategy == "s2c2a"


WRONG = {
    "another form": (
        {"strategy_options": {"options": {"layers": 1, "hidden": 8, "heads": 2}}},
        "heads",
    ),
    "size": ({"strategy_options": {"options": {"layers": 0, "hidden": 8}}}, "damaged"),
}


@pytest.mark.parametrize(("metadata", "message"), WRONG.values(), ids=WRONG)
def test_metadata_that_cannot_be_are_refused(file, forged, metadata, message):
    changed = forged(file, lambda known, found: known.update(metadata))
    with pytest.raises(StrategyError, match=message):
        load_networks(changed)
