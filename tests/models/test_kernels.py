"""Kernel regression: interpolation of samples and unused features."""

import jax
import jax.numpy as jnp
import numpy as np

from s2c2a.models.kernels import Kernels, fit_kernels, matern

POINTS = 200


def samples(count=400, seed=0, noise=0.01):
    """A curved surface over two features, with a third one that has no effect."""
    random = np.random.default_rng(seed)
    features = random.uniform(-1, 1, (count, 3))
    clean = np.stack(
        [np.sin(3 * features[:, 0]) + features[:, 1], features[:, 0] * features[:, 1]],
        axis=-1,
    )
    return features, clean + random.normal(0, noise, clean.shape)


def fit(features=None, targets=None):
    default_features, default_targets = samples()
    if features is None:
        features = default_features
    if targets is None:
        targets = default_targets
    return fit_kernels(features, targets, np.eye(3), POINTS)


def test_predictions_of_new_samples_are_accurate():
    features, targets = samples(seed=1, noise=0.0)
    inside = np.abs(features).max(axis=1) < 0.9
    error = np.asarray(fit()(jnp.asarray(features, jnp.float32))) - targets
    assert np.sqrt((error[inside] ** 2).mean()) < 0.03


def test_a_feature_without_effect_gets_the_longest_length_scale():
    rates = np.asarray(fit().rates)
    assert rates[2] < 0.3 * rates[:2].min()


def test_outputs_that_are_never_known_stay_zero():
    features, targets = samples()
    targets = np.column_stack([targets, np.full(len(targets), np.nan)])
    predicted = np.asarray(fit(targets=targets)(jnp.asarray(features, jnp.float32)))
    assert (predicted[:, 2] == 0.0).all()
    assert np.abs(predicted[:, :2] - targets[:, :2]).mean() < 0.03


def test_with_too_few_samples_the_output_is_zero():
    features, targets = samples(count=20)
    unfitted = fit(features=features, targets=targets)
    assert np.all(np.asarray(unfitted(jnp.asarray(features, jnp.float32))) == 0.0)
    assert jax.tree.map(jnp.shape, unfitted) == jax.tree.map(jnp.shape, fit())
    assert jax.tree.map(jnp.shape, unfitted) == jax.tree.map(
        jnp.shape, Kernels.unfitted(3, 2, POINTS)
    )


def test_the_kernel_is_one_at_its_point_falls_with_distance_and_is_smooth():
    points = jnp.array([[0.0, 0.0], [1.0, 0.0]])
    values = matern(jnp.zeros(2), points)
    d = np.sqrt(5.0)
    np.testing.assert_allclose(
        values, [1.0, (1 + d + d * d / 3) * np.exp(-d)], atol=1e-5
    )
    assert np.isfinite(
        jax.jacfwd(lambda point: matern(point, points))(jnp.zeros(2))
    ).all()
