"""Priors over arms: pooled recordings, mean and spread of parameters."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.errors import TrainingError
from s2c2a.models import C2SOptions, ChainOptions
from s2c2a.models.prior import MIN_SPREAD, mean_and_spread, pooled
from s2c2a.training import FitOptions, TrainingData
from s2c2a.training.fit import parameters

SIZE = ChainOptions(hidden=4, depth=1, play_widths=(0.03,), creep_times=(2.0,))


def with_stiffness(chain, logarithm: float):
    """The same chain with one logarithm of the stiffness in all modules."""
    stiffness = jnp.full_like(chain.equilibrium.log_stiffness, logarithm)
    return eqx.tree_at(lambda one: one.equilibrium.log_stiffness, chain, stiffness)


def zeros(arm, episodes: int, samples: int) -> TrainingData:
    """Episodes of an arm that does not move."""
    shape = (episodes, samples, arm.module_count)
    return TrainingData(
        arm, np.zeros((*shape, 3)), np.zeros((*shape, 4)), np.zeros((*shape, 6))
    )


@pytest.mark.slow
def test_mean_and_spread_of_two_models_are_those_of_every_parameter(twin):
    chain = SIZE.untrained(twin, jax.random.key(0))
    models = [with_stiffness(chain, 1.0), with_stiffness(chain, 2.0)]
    mean, spread = mean_and_spread(models)
    np.testing.assert_allclose(mean.equilibrium.log_stiffness, 1.5)
    np.testing.assert_allclose(spread.equilibrium.log_stiffness, 0.5)
    np.testing.assert_allclose(mean.mixing, chain.mixing)
    np.testing.assert_allclose(spread.mixing, MIN_SPREAD)


def test_fixed_parts_have_no_spread(twin):
    chain = SIZE.untrained(twin, jax.random.key(0))
    _, spread = mean_and_spread([chain, chain])
    widths = spread.hysteresis.operators.widths
    np.testing.assert_array_equal(widths, chain.hysteresis.operators.widths)
    assert all(bool((values > 0).all()) for values in parameters(spread))


def test_pooled_episodes_are_those_of_all_arms(twin):
    arms = [zeros(twin, 2, 60), replace(zeros(twin, 1, 60), lengths=(50,))]
    together = pooled(arms)
    assert together.states.shape[:2] == (3, 60)
    assert together.lengths == (60, 60, 50)


def test_one_arm_is_no_prior(twin):
    with pytest.raises(TrainingError, match="at least 2"):
        pooled([zeros(twin, 2, 60)])


def test_arms_with_episodes_of_different_lengths_are_rejected(twin):
    with pytest.raises(TrainingError, match="same options"):
        pooled([zeros(twin, 2, 60), zeros(twin, 2, 70)])


def test_models_without_a_prior_are_rejected(twin):
    with pytest.raises(TrainingError, match="have no prior"):
        C2SOptions(layers=1, hidden=4).pretrain([], FitOptions(), jax.random.key(0))
