"""The local model: it goes through the data, and goes on straight where there are none."""

import jax
import jax.numpy as jnp
import numpy as np

from s2c2a.models.kernels import Kernels, fitted_kernels, matern

POINTS = 200


def samples(count=400, seed=0, noise=0.01):
    """A bent surface over two features that count, beside one that does not."""
    random = np.random.default_rng(seed)
    features = random.uniform(-1, 1, (count, 3))
    clean = np.stack(
        [np.sin(3 * features[:, 0]) + features[:, 1], features[:, 0] * features[:, 1]],
        axis=-1,
    )
    return features, clean + random.normal(0, noise, clean.shape)


def fitted(**changes):
    features, targets = samples()
    given = {
        "features": features,
        "targets": targets,
        "kinds": np.eye(3),
        "count": POINTS,
    } | changes
    return fitted_kernels(**given)


def test_it_says_what_samples_say_where_it_has_not_seen_them():
    features, targets = samples(seed=1, noise=0.0)
    inside = np.abs(features).max(axis=1) < 0.9
    error = np.asarray(fitted()(jnp.asarray(features, jnp.float32))) - targets
    assert np.sqrt((error[inside] ** 2).mean()) < 0.03


def test_a_feature_that_says_nothing_gets_the_longest_length():
    rates = np.asarray(fitted().rates)
    assert rates[2] < 0.3 * rates[:2].min()


def test_outputs_that_are_never_known_are_left_alone():
    features, targets = samples()
    targets = np.column_stack([targets, np.full(len(targets), np.nan)])
    said = np.asarray(fitted(targets=targets)(jnp.asarray(features, jnp.float32)))
    assert (said[:, 2] == 0.0).all()
    assert np.abs(said[:, :2] - targets[:, :2]).mean() < 0.03


def test_of_too_few_samples_it_says_nothing():
    features, targets = samples(count=20)
    silent = fitted(features=features, targets=targets)
    assert np.all(np.asarray(silent(jnp.asarray(features, jnp.float32))) == 0.0)
    assert jax.tree.map(jnp.shape, silent) == jax.tree.map(jnp.shape, fitted())
    assert jax.tree.map(jnp.shape, silent) == jax.tree.map(
        jnp.shape, Kernels.silent(3, 2, POINTS)
    )


def test_the_kernel_is_one_at_a_point_falls_with_distance_and_has_a_slope_there():
    points = jnp.array([[0.0, 0.0], [1.0, 0.0]])
    values = matern(jnp.zeros(2), points)
    d = np.sqrt(5.0)
    np.testing.assert_allclose(
        values, [1.0, (1 + d + d * d / 3) * np.exp(-d)], atol=1e-5
    )
    assert np.isfinite(
        jax.jacfwd(lambda place: matern(place, points))(jnp.zeros(2))
    ).all()
