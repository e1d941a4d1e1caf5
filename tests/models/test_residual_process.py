"""Gaussian processes of residuals: interpolation, unused features, and correlated noise."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.models.residual_process import ResidualProcess, fit_process, matern

POINTS = 200
SAMPLES = 2500  # a hundred far apart in time


def samples(count=SAMPLES, seed=0, noise=0.01):
    """A curved surface over two features, with a third one that has no effect."""
    random = np.random.default_rng(seed)
    features = random.uniform(-1, 1, (count, 3))
    clean = np.stack(
        [np.sin(3 * features[:, 0]) + features[:, 1], features[:, 0] * features[:, 1]],
        axis=-1,
    )
    return features, clean + random.normal(0, noise, clean.shape)


def fit(features, targets) -> ResidualProcess:
    kinds = np.eye(features.shape[1])
    return fit_process(features, targets, kinds, np.zeros(len(kinds)), POINTS)


@pytest.fixture(scope="module")
def fitted() -> ResidualProcess:
    return fit(*samples())


def means(process, features) -> np.ndarray:
    return np.asarray(process(jnp.asarray(features, jnp.float32)))


def variances(process, features) -> np.ndarray:
    return np.asarray(process.variance(jnp.asarray(features, jnp.float32)))


def test_predictions_of_new_samples_are_accurate(fitted):
    features, targets = samples(400, seed=1, noise=0.0)
    inside = np.abs(features).max(axis=1) < 0.9
    error = means(fitted, features) - targets
    assert np.sqrt((error[inside] ** 2).mean()) < 0.03


def test_a_feature_without_effect_gets_the_longest_length_scale(fitted):
    rates = np.asarray(fitted.rates)
    assert rates[2] < 0.5 * rates[:2].min()


def test_outputs_that_are_never_known_stay_zero():
    features, targets = samples()
    targets = np.column_stack([targets, np.full(len(targets), np.nan)])
    predicted = means(fit(features, targets), features)
    assert (predicted[:, 2] == 0.0).all()
    assert np.abs(predicted[:, :2] - targets[:, :2]).mean() < 0.03


def test_with_too_few_samples_it_is_zero_and_has_the_same_arrays(fitted):
    features, targets = samples(count=20)
    without = fit(features, targets)
    assert (means(without, features) == 0.0).all()
    assert (variances(without, features) == 0.0).all()
    assert not without.is_fitted
    assert jax.tree.map(jnp.shape, without) == jax.tree.map(jnp.shape, fitted)


def test_the_variance_grows_from_the_samples_to_that_of_the_residual(fitted):
    ray = np.array([1.0, 1.0, 1.0])
    at = variances(fitted, np.array([0.0, 3.0, 6.0, 50.0])[:, None] * ray)
    assert (np.diff(at) > 0).all()
    assert at[0] < 0.02 * at[-1]
    np.testing.assert_allclose(at[-1], fitted.amplitude, rtol=1e-4)


def test_far_from_the_samples_the_mean_is_that_of_the_residual(fitted):
    _, targets = samples()
    np.testing.assert_allclose(
        means(fitted, np.full((1, 3), 50.0))[0], targets.mean(axis=0), atol=1e-5
    )


@pytest.mark.slow
def test_vibration_is_noise_though_it_follows_each_motion():
    """Neighbors in time are alike: a process of all samples would interpolate them."""
    random = np.random.default_rng(0)
    steps = np.arange(SAMPLES)
    features = np.cumsum(random.normal(0, 0.1, (SAMPLES, 2)), axis=0)
    vibration = np.sin(0.7 * steps + np.cumsum(random.normal(0, 0.1, SAMPLES)))
    process = fit(features, vibration[:, None])
    assert process.noise > 5 * process.amplitude
    assert np.abs(means(process, features)).mean() < 0.3


def test_the_motion_of_a_second_is_no_longer_than_the_length_scale(fitted):
    features, targets = samples()
    kinds, motion = np.eye(3), np.full(3, 5.0)
    smooth = fit_process(features, targets, kinds, motion, POINTS)
    assert np.linalg.norm(fitted.rates * motion) > 1.1
    assert np.linalg.norm(smooth.rates * motion) < 1.001


@pytest.mark.slow
def test_given_other_samples_it_keeps_its_hyperparameters_and_knows_these_alone(fitted):
    features, targets = samples(300, seed=2)
    near = features[:, 0] < 0.0
    half = fitted.given(features[near], targets[near])
    assert (half.rates == fitted.rates).all()
    errors = np.abs(means(half, features) - targets).mean(axis=1)
    assert errors[near].mean() < 0.3 * errors[~near].mean()
    deviations = half.deviations(features)
    assert deviations[near].mean() < deviations[~near].mean()
    # noise included: its own samples deviate, too
    assert deviations.min() > 0.999 * np.sqrt(float(fitted.noise))


@pytest.mark.slow
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
