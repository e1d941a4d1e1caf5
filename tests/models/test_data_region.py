"""Region of the training data: none beyond it counts as known."""

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.models.data_region import DataRegion, fit_region


def region(reach: float = 1.0) -> DataRegion:
    random = np.random.default_rng(0)
    training = random.uniform(-reach, reach, (600, 3))
    validation = random.uniform(-reach, reach, (200, 3))
    return fit_region(training, validation, 40)


def test_near_validation_data_there_is_no_extrapolation():
    inside = np.random.default_rng(1).uniform(-0.9, 0.9, (100, 3))
    np.testing.assert_allclose(
        region().extrapolation(jnp.asarray(inside)), 0.0, atol=0.03
    )


def test_it_grows_with_the_distance_to_one():
    rays = np.array([[1.0, 1.0, 1.0], [-1.0, 0.5, 0.0]])
    near, further, far = (
        region().extrapolation(jnp.asarray(scale * rays)) for scale in (1.5, 2.5, 40.0)
    )
    assert (near < further).all()
    assert (further < far).all()
    np.testing.assert_allclose(far, 1.0, rtol=0.05)


def test_it_grows_beyond_the_reach_of_the_data():
    point = jnp.array([[0.9, 0.9, 0.9]])
    narrow, wide = (float(region(reach).extrapolation(point)[0]) for reach in (0.4, 1))
    assert narrow > 5 * wide + 0.005


@pytest.mark.slow
def test_a_change_of_a_constant_feature_is_extrapolation():
    features = np.random.default_rng(0).uniform(-1, 1, (300, 2))
    features[:, 1] = 0.0
    known = fit_region(features, features, 30)
    assert float(known.extrapolation(jnp.array([0.0, 0.0]))) < 0.005
    assert float(known.extrapolation(jnp.array([0.0, 1.0]))) > 0.1


def test_without_data_nothing_is_extrapolation():
    anywhere = DataRegion.everywhere(3, 40).extrapolation(jnp.ones((5, 3)))
    np.testing.assert_array_equal(anywhere, 0.0)
