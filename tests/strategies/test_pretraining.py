"""A prior over two randomized arms, and networks of a third from it."""

from dataclasses import replace
from pathlib import Path

import equinox as eqx
import jax
import numpy as np
import pytest

from s2c2a import jobs
from s2c2a.arm import randomized_arm
from s2c2a.errors import S2C2AError, StrategyError, TrainingError
from s2c2a.models import LocalOptions
from s2c2a.strategies import (
    load_networks,
    save_networks,
    train_s2c2a,
    training_data,
)
from s2c2a.strategies.s2c2a import check_prior
from s2c2a.training.fit import parameters


@pytest.fixture(scope="module")
def cache(tmp_path_factory) -> jobs.Cache:
    return jobs.Cache(tmp_path_factory.mktemp("prior"), threads=1)


@pytest.fixture(scope="module")
def prior_key(twin, tiny_best_recipe) -> jobs.PriorNetworks:
    return jobs.PriorNetworks(twin, tiny_best_recipe, 0, 2, 0.5, 2, 100)


@pytest.fixture(scope="module")
def prior(prior_key, cache):
    return jobs.make_all([prior_key], cache)[0]


def test_arms_of_a_prior_are_not_those_of_evaluations(prior_key):
    names = [recording.arm.name for recording in prior_key.needs]
    assert names == ["twin_arm_50_1000", "twin_arm_50_1001"]


@pytest.mark.slow
def test_a_file_keeps_the_spread(prior, twin, tmp_path):
    save_networks(prior, tmp_path / "prior.safetensors")
    read = load_networks(tmp_path / "prior.safetensors", twin)
    saved = parameters(prior.trained["C2S"].spread)
    for mine, theirs in zip(parameters(read.trained["C2S"].spread), saved, strict=True):
        np.testing.assert_array_equal(mine, theirs)


@pytest.mark.slow
def test_a_spread_of_zero_is_rejected(prior, forged, tmp_path):
    path = tmp_path / "prior.safetensors"
    save_networks(prior, path)

    def without_spread(_metadata, arrays):
        arrays["spread.mixing"] = np.zeros_like(arrays["spread.mixing"])

    with pytest.raises(StrategyError, match="not positive"):
        load_networks(forged(Path(path), without_spread))


@pytest.mark.slow
def test_networks_trained_from_a_prior_are_no_prior(prior, recording, tiny_best_recipe):
    trained = train_s2c2a(recording, tiny_best_recipe, 0, start=prior)
    assert not trained.is_prior
    assert np.isfinite(trained.trained["C2S"].curve).all()
    np.testing.assert_array_equal(
        trained.c2a.network.weight_head, prior.c2a.network.weight_head
    )


def as_prior(networks):
    """The networks with an empty spread."""
    c2s = replace(networks.trained["C2S"], spread=())
    return replace(networks, trained={**networks.trained, "C2S": c2s})


def test_only_a_prior_of_this_arm_and_recipe_is_a_start(
    tiny_networks, tiny_best_networks, recording, tiny_best_recipe, twin
):
    def start(networks):
        train_s2c2a(recording, tiny_best_recipe, 0, start=networks)

    with pytest.raises(StrategyError, match="of the one arm"):
        start(tiny_best_networks)
    shorter = [module.model_copy(update={"length": 0.1}) for module in twin.modules]
    other = twin.model_copy(update={"modules": tuple(shorter)})
    with pytest.raises(StrategyError, match=r"in modules\.0\.length 0\.1, now 0\.2"):
        start(as_prior(replace(tiny_best_networks, arm=other)))
    with pytest.raises(StrategyError, match="differs in c2s"):
        start(as_prior(tiny_networks))


def test_a_prior_serves_every_variant_of_its_arm(tiny_best_networks, twin):
    prior = as_prior(tiny_best_networks)
    recipe = tiny_best_networks.recipe
    check_prior(prior, recipe.seen_arm(randomized_arm(twin, 0, 0.5)), recipe)


def test_forward_models_without_a_prior_say_so(tiny_networks, recording):
    options = tiny_networks.recipe.c2s
    data = training_data(recording, tiny_networks.recipe)
    with pytest.raises(TrainingError, match="begin from nothing"):
        options.resume_training(
            tiny_networks.c2s, (), data, tiny_networks.recipe.c2s_fit, jax.random.key(0)
        )


@pytest.mark.slow
def test_parameters_of_little_spread_change_less(prior, recording, tiny_best_recipe):
    data = training_data(recording, tiny_best_recipe)

    def change(factor: float) -> float:
        numbers, rest = eqx.partition(prior.trained["C2S"].spread, eqx.is_inexact_array)
        scaled = jax.tree.map(lambda values: factor * values, numbers)
        trained = tiny_best_recipe.c2s.resume_training(
            prior.c2s,
            eqx.combine(scaled, rest),
            data,
            tiny_best_recipe.c2s_fit,
            jax.random.key(0),
        )
        pairs = zip(parameters(trained.network), parameters(prior.c2s), strict=True)
        return sum(float(((after - before) ** 2).sum()) for after, before in pairs)

    assert change(0.01) < 0.5 * change(100.0)


@pytest.mark.slow
def test_the_local_model_of_a_prior_has_no_process(prior_key, cache):
    recipe = prior_key.recipe
    chain = recipe.c2s
    local = LocalOptions(
        chain.hidden, chain.depth, chain.play_widths, chain.creep_times, points=16
    )
    arms = [training_data(need.load(cache), recipe) for need in prior_key.needs]
    learned = local.pretrain(arms, recipe.c2s_fit, jax.random.key(0))
    assert not learned.network.process.is_fitted


@pytest.mark.parametrize("change", [{"arms": 1}, {"strength": 0.0}])
def test_a_prior_without_variants_is_rejected(prior_key, change):
    with pytest.raises(S2C2AError, match="was asked for"):
        replace(prior_key, **change)
