"""Extrapolation: none where data were held out, and more and more where there were none."""

import jax.numpy as jnp
import numpy as np

from s2c2a.models.uncertainty import IGNORANCE, Known, known_from

LENGTH = 0.6


def told(reach: float = 1.0) -> Known:
    """Of places within a reach, where a model of two modules was off by 1 and 3 mm."""
    random = np.random.default_rng(0)
    places, others = (
        random.uniform(-reach, reach, (600, 3)),
        random.uniform(-reach, reach, (200, 3)),
    )
    return known_from(places, others, np.tile([1e-3, 3e-3], (200, 1)), 40, LENGTH)


def test_where_data_were_held_out_errors_are_as_there_and_there_is_no_doubt():
    inside = np.random.default_rng(1).uniform(-0.9, 0.9, (100, 3))
    np.testing.assert_allclose(told().meters(jnp.asarray(inside)), 0.0, atol=1e-3)
    np.testing.assert_allclose(told().usual_error, [1e-3, 3e-3], rtol=1e-5)


def test_far_from_all_data_nothing_is_known():
    rays = np.array([[1.0, 1.0, 1.0], [-1.0, 0.5, 0.0]])
    near, further, far = (
        told().meters(jnp.asarray(scale * rays)) for scale in (1.5, 2.5, 40.0)
    )
    assert (near < further).all()
    assert (further < far).all()
    np.testing.assert_allclose(far, LENGTH * IGNORANCE, rtol=0.05)


def test_it_grows_beyond_the_reach_of_the_data():
    place = jnp.array([[0.9, 0.9, 0.9]])
    assert (
        float(told(0.4).meters(place)[0]) > 5 * float(told(1.0).meters(place)[0]) + 1e-3
    )


def test_distances_that_are_not_known_do_not_count():
    places = np.random.default_rng(0).uniform(-1, 1, (300, 2))
    distances = np.full((300, 2), np.nan)
    distances[::3, 1] = 2e-3
    np.testing.assert_allclose(
        known_from(places, places, distances, 30, LENGTH).usual_error,
        [0.0, 2e-3],
        rtol=1e-5,
    )


def test_where_nothing_was_moved_nothing_is_known():
    places = np.random.default_rng(0).uniform(-1, 1, (300, 2))
    places[:, 1] = 0.0
    doubt = known_from(places, places, np.full((300, 1), 1e-3), 30, LENGTH)
    assert float(doubt.meters(jnp.array([0.0, 0.0]))) < 1e-3
    assert float(doubt.meters(jnp.array([0.0, 1.0]))) > 0.02
