"""Uncertainty: none near validation data, and more with distance from all data."""

import jax.numpy as jnp
import numpy as np

from s2c2a.models.uncertainty import PRIOR_STD, Uncertainty, fit_uncertainty

LENGTH = 0.6


def uncertainty(reach: float = 1.0) -> Uncertainty:
    """Of data within a reach, where a model of two modules errs by 1 and 3 mm."""
    random = np.random.default_rng(0)
    training = random.uniform(-reach, reach, (600, 3))
    validation = random.uniform(-reach, reach, (200, 3))
    return fit_uncertainty(
        training, validation, np.tile([1e-3, 3e-3], (200, 1)), 40, LENGTH
    )


def test_near_validation_data_there_is_no_extrapolation():
    inside = np.random.default_rng(1).uniform(-0.9, 0.9, (100, 3))
    np.testing.assert_allclose(
        uncertainty().tip_extrapolation(jnp.asarray(inside)), 0.0, atol=5e-3
    )
    np.testing.assert_allclose(
        uncertainty().interpolation_error, [1e-3, 3e-3], rtol=1e-5
    )


def test_far_from_all_data_the_uncertainty_reaches_its_limit():
    rays = np.array([[1.0, 1.0, 1.0], [-1.0, 0.5, 0.0]])
    near, further, far = (
        uncertainty().tip_extrapolation(jnp.asarray(scale * rays))
        for scale in (1.5, 2.5, 40.0)
    )
    assert (near < further).all()
    assert (further < far).all()
    np.testing.assert_allclose(far, LENGTH * PRIOR_STD, rtol=0.05)


def test_it_grows_beyond_the_reach_of_the_data():
    point = jnp.array([[0.9, 0.9, 0.9]])
    assert (
        float(uncertainty(0.4).tip_extrapolation(point)[0])
        > 5 * float(uncertainty(1.0).tip_extrapolation(point)[0]) + 1e-3
    )


def test_unknown_distances_do_not_count():
    features = np.random.default_rng(0).uniform(-1, 1, (300, 2))
    distances = np.full((300, 2), np.nan)
    distances[::3, 1] = 2e-3
    np.testing.assert_allclose(
        fit_uncertainty(features, features, distances, 30, LENGTH).interpolation_error,
        [0.0, 2e-3],
        rtol=1e-5,
    )


def test_a_change_of_a_constant_feature_is_extrapolation():
    features = np.random.default_rng(0).uniform(-1, 1, (300, 2))
    features[:, 1] = 0.0
    extrapolating = fit_uncertainty(
        features, features, np.full((300, 1), 1e-3), 30, LENGTH
    )
    assert float(extrapolating.tip_extrapolation(jnp.array([0.0, 0.0]))) < 1e-3
    assert float(extrapolating.tip_extrapolation(jnp.array([0.0, 1.0]))) > 0.02
