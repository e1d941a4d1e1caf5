"""Play operators and filters: worked by hand for one cable, laws for many."""

from dataclasses import replace
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.models.cables import MAX_CREEP, Hysteresis, Operators, Viscoelasticity

WIDTHS = (0.5, 1.0)
SHARES = (0.1, 0.4)


def a_hysteresis(modules=1, widths=WIDTHS, shares=SHARES, seed=0) -> Hysteresis:
    random = np.random.default_rng(seed)

    def normal(count):
        return jnp.asarray(random.normal(size=(modules, count, 1)), jnp.float32)

    return Hysteresis(
        Operators(jnp.asarray(widths), jnp.asarray(shares, jnp.float32)),
        normal(len(widths) + 2),
        jnp.zeros((modules, 0, 1)),
        Viscoelasticity(normal(1), normal(len(shares))),
    )


def along(hysteresis, path):
    """The memory after every displacement of one cable, the first one at rest."""
    shaped = jnp.asarray(path, dtype=jnp.float32)[:, None, None]
    memories = [hysteresis.start(shaped[0])]
    for displacement in shaped[1:]:
        memories.append(hysteresis.advance(displacement, memories[-1]))
    return memories


def plays_along(hysteresis, path):
    """Outputs of the plays of one cable, shape (steps, widths)."""
    return np.array([memory.plays[0, :, 0] for memory in along(hysteresis, path)])


def walk(seed, *shape):
    return jnp.asarray(
        np.cumsum(np.random.default_rng(seed).normal(0, 0.4, shape), axis=0),
        dtype=jnp.float32,
    )


def test_a_play_follows_the_sequence_worked_by_hand():
    """Of half-width 0.5 and 1: stay within the band, then follow its edge."""
    path = [0.0, 0.4, 2.0, 1.6, 0.5, 0.9, -1.0]
    narrow = [0.0, 0.0, 1.5, 1.5, 1.0, 1.0, -0.5]
    wide = [0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0]
    np.testing.assert_allclose(
        plays_along(a_hysteresis(), path), np.transpose([narrow, wide]), atol=1e-6
    )


def test_a_play_is_independent_of_the_rate():
    turns = [0.0, 2.0, -1.0, 0.7]
    slow = np.concatenate([np.linspace(a, b, 50) for a, b in pairwise(turns)])
    hysteresis = a_hysteresis()
    np.testing.assert_allclose(
        plays_along(hysteresis, slow)[-1], plays_along(hysteresis, turns)[-1], atol=1e-6
    )


def test_at_rest_every_play_is_in_its_middle_and_stays_there():
    memories = along(a_hysteresis(), [0.3] * 5)
    for memory in memories:
        np.testing.assert_allclose(memory.plays, np.full((1, 2, 1), 0.3), atol=1e-7)
        np.testing.assert_allclose(memory.crept, np.full((1, 2, 1), 0.3), atol=1e-7)


def test_a_play_is_never_further_from_its_input_than_its_width():
    path = np.asarray(walk(1, 60))
    lag = np.abs(plays_along(a_hysteresis(), path) - path[:, None])
    assert (lag <= np.array(WIDTHS) + 1e-5).all()
    np.testing.assert_allclose(lag.max(axis=0), WIDTHS, atol=1e-5)


def test_a_filter_approaches_a_held_step_as_the_exponential():
    """With share 1 - exp(-period / tau), the response is 1 - exp(-t / tau), exactly."""
    period = 0.1
    times = np.array([0.5, 3.0])
    hysteresis = a_hysteresis(shares=1 - np.exp(-period / times))
    crept = np.array(
        [memory.crept[0, :, 0] for memory in along(hysteresis, [0.0] + [1.0] * 30)]
    )
    expected = 1 - np.exp(-period * np.arange(31)[:, None] / times)
    np.testing.assert_allclose(crept, expected, atol=1e-5)


def test_inputs_are_displacement_plays_last_displacement_and_filters_in_this_order():
    hysteresis = a_hysteresis()
    memory = hysteresis.start(jnp.array([[1.0]]))
    inputs = hysteresis.inputs(jnp.array([[3.0]]), memory)
    np.testing.assert_allclose(
        inputs[0, :, 0], [3.0, 2.5, 2.0, 1.0, 1.2, 1.8], atol=1e-6
    )


def test_transmitted_displacements_are_weighted_sums():
    hysteresis = a_hysteresis(modules=2)
    inputs = walk(2, 2, 6, 3)
    raw = np.asarray(hysteresis.play_weights)
    creep = np.asarray(hysteresis.creep.weights)
    weights = np.concatenate([np.log1p(np.exp(raw)), creep], axis=1)
    expected = (weights * np.asarray(inputs)).sum(axis=-2)
    np.testing.assert_allclose(hysteresis.transmitted(inputs), expected, atol=1e-5)


def test_weights_of_plays_are_never_negative():
    """Unit inputs of single play operators return their weights."""
    hysteresis = a_hysteresis()
    low = replace(
        hysteresis, play_weights=jnp.array([[-50.0, -5.0, 0.0, 5.0]])[..., None]
    )
    weights = [
        float(low.transmitted(jnp.eye(6)[None, place, :, None])[0, 0])
        for place in range(4)
    ]
    assert min(weights) >= 0.0
    np.testing.assert_allclose(weights, [0.0, 0.006715, np.log(2), 5.006715], atol=1e-5)


@pytest.mark.parametrize(("engaged", "slope"), [(False, 0.0), (True, 1.0)])
def test_within_a_play_slopes_are_one_where_engaged_and_zero_else(engaged, slope):
    hysteresis = replace(a_hysteresis(), engaged=engaged)
    memory = hysteresis.start(jnp.zeros((1, 1)))

    def play(displacement):
        return hysteresis.advance(displacement.reshape(1, 1), memory).plays[0, 0, 0]

    assert float(jax.grad(play)(jnp.array(0.2))) == pytest.approx(slope)
    assert float(jax.grad(play)(jnp.array(0.9))) == pytest.approx(1.0)


def test_creep_weights_have_one_sign_and_a_bounded_sum():
    random = np.random.default_rng(3)
    creep = Viscoelasticity(
        jnp.asarray(random.normal(0.0, 50.0, (40, 1, 3))),
        jnp.asarray(random.normal(0.0, 50.0, (40, 4, 3))),
    )
    signs = np.sign(creep.weights)
    assert (signs * signs[:, :1] >= 0.0).all()
    assert np.abs(creep.weights.sum(axis=-2)).max() <= MAX_CREEP * (1 + 1e-6)


def test_creep_is_begun_at_given_weights_of_one_sign():
    weights = jnp.array([[-0.1], [-0.2], [0.0]])[None]
    begun = Viscoelasticity.from_weights(weights).weights
    np.testing.assert_allclose(begun.sum(), -0.3, rtol=1e-5)
    np.testing.assert_allclose(begun, weights, atol=0.02)
