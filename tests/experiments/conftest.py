"""Shipped networks of both arms, and trained ones of the paper's recipe."""

from dataclasses import replace

import pytest

from s2c2a.arm import load_arm
from s2c2a.cli.demo import ARMS
from s2c2a.jobs import Cache, GivenNetworks, RecordingArtifact, made
from s2c2a.strategies import (
    recipe_named,
    save_networks,
    shipped_networks,
    train_s2c2a,
)
from s2c2a.training import FitOptions

SHORT = FitOptions(max_epochs=25, patience=25)


@pytest.fixture(scope="session")
def cache(tmp_path_factory):
    return Cache(tmp_path_factory.mktemp("cache"))


@pytest.fixture
def given(tmp_path):
    """A function that writes trained networks, and reads them as commands do."""

    def read(networks):
        path = tmp_path / f"{networks.recipe.name}.safetensors"
        save_networks(networks, path)
        return GivenNetworks.read(path, networks.arm)

    return read


@pytest.fixture(scope="session")
def trained():
    """Shipped networks of both arms by the recipe `best`: name -> TrainedNetworks."""
    return {name: shipped_networks(load_arm(name)) for name in ARMS}


@pytest.fixture(scope="session")
def trained_as_the_paper(cache):
    """Networks of the twin by the recipe `paper` with fewer epochs."""
    recipe = replace(recipe_named("paper"), c2s_fit=SHORT, c2a_fit=SHORT)
    twin = load_arm("twin_arm")
    recording = made(RecordingArtifact(twin, recipe.collect_options()), cache)
    return train_s2c2a(recording, recipe, seed=0)


@pytest.fixture(scope="session")
def asked():
    """Jobs that a study asks for, instead of making them."""

    class RequestedError(Exception):
        pass

    def make(jobs):
        raise RequestedError(jobs)

    def ask(rows_of_study, study) -> list:
        with pytest.raises(RequestedError) as requested:
            rows_of_study(study, make)
        return requested.value.args[0]

    return ask
