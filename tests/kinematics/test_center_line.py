"""The center line from states against exact arcs."""

import jax
import numpy as np
import pytest

from s2c2a.kinematics import center_line, states_from_bends
from s2c2a.spaces import CENTER_LINE_POINTS

SHARES = np.arange(1, CENTER_LINE_POINTS + 1) / CENTER_LINE_POINTS


def line_of(bends, lengths):
    bends, lengths = np.asarray(bends, np.float32), np.asarray(lengths, np.float32)
    return np.asarray(center_line(states_from_bends(bends, lengths), lengths))


def arc(angle, direction, length):
    """Points of one arc from the base at even parts of its length."""
    angles, radius = angle * SHARES, length / angle
    aside = radius * np.outer(
        [np.cos(direction), np.sin(direction)], 1 - np.cos(angles)
    )
    return np.array([*aside, radius * np.sin(angles)]).T


def random_bends(*shape):
    return np.random.default_rng(0).uniform(-0.6, 0.6, (*shape, 2))


def test_a_straight_arm_has_its_points_evenly_on_the_axis():
    line = line_of(np.zeros((2, 2)), [0.2, 0.3])
    heights = [0.04, 0.08, 0.12, 0.16, 0.20, 0.26, 0.32, 0.38, 0.44, 0.50]
    np.testing.assert_allclose(line, [[0, 0, height] for height in heights], atol=1e-7)


def test_the_error_grows_with_the_third_power_of_the_bend():
    """Half the angle gives about an eighth of the error, as expected of a cubic."""
    small, large = (
        np.abs(line_of([[angle, 0]], [0.2]) - arc(angle, 0, 0.2)).max()
        for angle in (0.4, 0.8)
    )
    assert 1e-5 < large < 1e-3
    assert 7 < large / small < 8


def test_equal_bends_are_points_of_one_big_arc():
    angles = 0.9 * np.arange(1, 16) / 15
    radius = 0.6 / 0.9
    exact = radius * np.array([1 - np.cos(angles), np.zeros(15), np.sin(angles)]).T
    np.testing.assert_allclose(line_of([[0.3, 0.0]] * 3, [0.2] * 3), exact, atol=1e-4)


def test_a_distal_module_bends_in_the_frame_of_the_proximal_end():
    """After a quarter turn towards x, the second arc begins along x."""
    quarter = np.pi / 2
    start = 0.2 / quarter * np.array([1.0, 0.0, 1.0])
    exact = arc(0.5, 0.0, 0.2)
    upper = start + np.stack([exact[:, 2], np.zeros(5), -exact[:, 0]], axis=-1)
    line = line_of([[quarter, 0], [0.5, 0]], [0.2, 0.2])
    np.testing.assert_allclose(line[5:], upper, atol=1e-3)


@pytest.mark.parametrize("lengths", [(0.2, 0.2, 0.2), (0.05, 0.3, 0.1)])
def test_the_last_point_of_each_module_is_its_end(lengths):
    bends = random_bends(3).astype(np.float32)
    ends = states_from_bends(bends, np.array(lengths, np.float32))[:, :3]
    line = line_of(bends, lengths)[CENTER_LINE_POINTS - 1 :: CENTER_LINE_POINTS]
    np.testing.assert_allclose(line, ends, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("points", [1, 5, 16])
def test_arrays_of_numpy_and_of_jax_have_one_center_line(points):
    lengths = np.full(3, 0.2, np.float32)
    states = np.asarray(
        states_from_bends(random_bends(4, 3).astype(np.float32), lengths)
    )
    exact = center_line(states.astype(float), lengths.astype(float), points)
    assert isinstance(exact, np.ndarray)
    assert (exact.dtype, exact.shape) == (np.float64, (4, 3 * points, 3))
    traced = jax.jit(center_line, static_argnums=2)(states, lengths, points)
    np.testing.assert_allclose(traced, exact, atol=1e-6)
    lengths = jax.numpy.asarray(lengths)
    slopes = jax.grad(lambda values: center_line(values, lengths, points).sum())
    assert np.isfinite(slopes(jax.numpy.asarray(states))).all()
