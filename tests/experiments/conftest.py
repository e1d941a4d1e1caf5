"""The real pipeline, once for all tests: 9000 samples and both networks of both arms, for both recipes."""

from dataclasses import replace

import pytest

from s2c2a.arm import load_arm
from s2c2a.data import CollectOptions
from s2c2a.experiments.circle import ARMS
from s2c2a.experiments.workshop import Workshop
from s2c2a.strategies import recipe_named, train_s2c2a
from s2c2a.training import FitOptions

SHORT = FitOptions(most_epochs=25, patience=25)


@pytest.fixture(scope="session")
def workshop(tmp_path_factory):
    return Workshop(tmp_path_factory.mktemp("workshop"))


@pytest.fixture(scope="session")
def trained(workshop):
    """Both arms' networks by the recipe `best`: name -> TrainedNetworks."""
    return {name: workshop.networks(load_arm(name), recipe_named("best"), seed=0) for name in ARMS}


@pytest.fixture(scope="session")
def trained_as_the_paper(workshop):
    """Both arms' networks by the recipe `paper`, with fewer epochs: name -> TrainedNetworks."""
    recipe = replace(recipe_named("paper"), c2s_fit=SHORT, c2a_fit=SHORT)
    options = CollectOptions(speeds=recipe.speeds)
    return {name: train_s2c2a(workshop.recording(load_arm(name), options), recipe, seed=0) for name in ARMS}
