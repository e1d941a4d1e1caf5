"""Bend biases learned over the shape: agreement, payload and forgetting."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.estimation.bias_field import (
    LENGTH,
    MEMORY,
    PICTURES,
    BiasField,
    PayloadPrior,
)

PERIOD = 0.2  # s
PRIOR = PayloadPrior(0.0, 0.1)
BIASES = np.array([0.06, -0.04], np.float32)
NONE = np.zeros(2, np.float32)
add = jax.jit(partial(BiasField.with_picture, prior=PRIOR))
at = jax.jit(BiasField.at)


def taught(shapes, caused, by_payload=NONE, field=None) -> BiasField:
    """A field after a picture of every shape."""
    field = BiasField.empty(2) if field is None else field
    for shape in shapes:
        field = field.aged(PERIOD)
        biases = caused(shape) if callable(caused) else caused
        slope = by_payload(shape) if callable(by_payload) else by_payload
        field = add(field, jnp.asarray(shape), biases, slope, jnp.float32(0.0))
    return field


def circle(steps=100) -> np.ndarray:
    angles = np.linspace(0.0, 4.0 * np.pi, steps)
    return 0.5 * np.stack([np.cos(angles), np.sin(angles)], axis=-1).astype(np.float32)


def test_before_any_picture_it_is_zero():
    assert not np.asarray(at(BiasField.empty(2), jnp.zeros(2))).any()


def test_it_learns_biases_where_they_were_seen_and_none_elsewhere():
    field = taught(circle(), BIASES)
    for shape in circle(7):
        np.testing.assert_allclose(at(field, jnp.asarray(shape)), BIASES, rtol=0.15)
    far = at(field, jnp.full(2, 10.0 * LENGTH))
    assert np.abs(far).max() < 1e-6


def test_biases_may_differ_with_the_shape():
    def by_shape(shape):
        return np.array([0.1 * shape[0], 0.0], np.float32)

    field = taught(circle(), by_shape)
    left, right = (at(field, jnp.array([x, 0.0]))[0] for x in (-0.5, 0.5))
    assert left < -0.03
    assert right > 0.03


def test_a_payload_is_left_to_the_payload():
    """It bends the arm in its own way, which no smooth field would."""

    def by_payload(shape):
        return np.float32(np.sign(shape[0])) * np.ones(2, np.float32)

    field = taught(circle(), lambda shape: 0.05 * by_payload(shape), by_payload)
    largest = max(np.abs(at(field, jnp.asarray(shape))).max() for shape in circle(9))
    assert largest < 0.3 * 0.05


def test_old_pictures_are_forgotten():
    field = taught(circle(), BIASES)
    old = at(field.aged(3.0 * MEMORY), jnp.array([0.5, 0.0]))
    np.testing.assert_allclose(old, np.exp(-3.0) * BIASES, rtol=0.2)
    changed = taught(circle(), -BIASES, field=field.aged(3.0 * MEMORY))
    np.testing.assert_allclose(at(changed, jnp.array([0.5, 0.0])), -BIASES, rtol=0.2)


def test_the_newest_pictures_count():
    random = np.random.default_rng(0)
    shapes = random.uniform(-0.5, 0.5, (PICTURES, 2)).astype(np.float32)
    field = taught(shapes, BIASES)
    field = taught(shapes, -BIASES, field=field)
    np.testing.assert_allclose(at(field, jnp.zeros(2)), -BIASES, rtol=0.05)


@pytest.mark.slow
def test_a_known_payload_is_no_bias():
    known = 0.05
    by_payload = np.full(2, 1.0, np.float32)
    field = BiasField.empty(2)
    for _ in range(30):
        field = field.aged(PERIOD)
        field = field.with_picture(
            jnp.zeros(2),
            jnp.asarray(known * by_payload),
            jnp.asarray(by_payload),
            jnp.float32(0.0),
            PayloadPrior(known, 0.1),
        )
    assert np.abs(at(field, jnp.zeros(2))).max() < 1e-5
