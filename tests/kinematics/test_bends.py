import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from s2c2a import kinematics
from s2c2a.arm import ArmGeometry, load_arm

configurations_from_bends = jax.jit(kinematics.configurations_from_bends)
bends_from_configurations = jax.jit(kinematics.bends_from_configurations)
limit_lengths = jax.jit(kinematics.limit_lengths)
gradient_of_configurations = jax.jit(jax.jacobian(kinematics.configurations_from_bends))
gradient_of_bends = jax.jit(jax.jacobian(kinematics.bends_from_configurations))

NEAR_ZERO = [0.0, 1e-8, 1e-5, 9.99e-4, 1e-3, 1.001e-3, 2e-3, 0.1, 1.0]
quick = settings(deadline=None, max_examples=30)


def directions():
    return st.floats(-np.pi, np.pi)


def bend(angle, direction):
    return angle * np.array([np.cos(direction), np.sin(direction)])


def slow_configuration(b):
    """Eq. (3) as printed, in float64: the direction of the bend is theta - pi/2."""
    angle, direction = np.hypot(*b), np.arctan2(b[1], b[0])
    return np.array([*bend(np.sin(angle), direction), np.cos(angle)])


def slow_bend(configuration):
    """Angle from the vertical times its direction, in float64."""
    x, y, z = configuration
    return bend(np.arctan2(np.hypot(x, y), z), np.arctan2(y, x))


def differences(function, place, step=1e-5):
    """Jacobian by central differences, in float64."""
    rows = [
        (function(place + step * unit) - function(place - step * unit)) / (2 * step)
        for unit in np.eye(len(place))
    ]
    return np.stack(rows, axis=-1)


def in_single(values):
    return np.asarray(values, np.float32)


def test_a_module_that_points_up_has_exactly_no_bend():
    np.testing.assert_array_equal(
        bends_from_configurations(np.array([0.0, 0.0, 1.0])), [0.0, 0.0]
    )


def test_ninety_degrees_to_the_left_point_left():
    found = configurations_from_bends(np.array([0.0, np.pi / 2]))
    np.testing.assert_allclose(found, [0, 1, 0], atol=1e-6)


@pytest.mark.parametrize("angle", NEAR_ZERO)
@pytest.mark.parametrize("direction", [0.0, 0.7, -2.0])
def test_configurations_and_their_gradient_are_exact_at_and_near_zero(angle, direction):
    b = in_single(bend(angle, direction))
    exact = np.asarray(b, np.float64)
    found = configurations_from_bends(b)
    np.testing.assert_allclose(found, slow_configuration(exact), rtol=1e-6, atol=1e-12)
    expected = differences(slow_configuration, exact)
    np.testing.assert_allclose(gradient_of_configurations(b), expected, atol=2e-6)


@pytest.mark.parametrize("angle", NEAR_ZERO)
@pytest.mark.parametrize("direction", [0.0, 0.7, -2.0])
def test_the_gradient_of_bends_is_exact_at_and_near_zero(angle, direction):
    configuration = in_single(slow_configuration(bend(angle, direction)))
    expected = differences(slow_bend, np.asarray(configuration, np.float64))
    np.testing.assert_allclose(gradient_of_bends(configuration), expected, atol=5e-6)


@quick
@given(st.floats(0, 3.0), directions())
def test_configurations_come_back_from_their_bends(angle, direction):
    configuration = in_single(slow_configuration(bend(angle, direction)))
    there_and_back = configurations_from_bends(bends_from_configurations(configuration))
    np.testing.assert_allclose(there_and_back, configuration, atol=1e-6)


@quick
@given(st.floats(0, 6.0), directions())
def test_configurations_have_length_one(angle, direction):
    found = configurations_from_bends(in_single(bend(angle, direction)))
    length = np.linalg.norm(np.asarray(found, np.float64))
    assert length == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("length", [1e-4, 1e-3, 0.01, 0.3, 0.6, 1.0, 5.0, 1000.0])
@pytest.mark.parametrize("angle", [1e-4, 0.1, 0.8, 2.5])
def test_the_length_of_an_axis_does_not_matter(length, angle):
    axis = in_single(length * slow_configuration(bend(angle, 0.7)))
    found = bends_from_configurations(axis)
    np.testing.assert_allclose(found, bend(angle, 0.7), rtol=1e-4)


@pytest.mark.parametrize("angle", [3.0, 3.1, 3.14, 3.141])
def test_a_module_bent_almost_straight_back_keeps_its_bend(angle):
    found = bends_from_configurations(in_single(slow_configuration(bend(angle, 0.7))))
    np.testing.assert_allclose(found, bend(angle, 0.7), atol=1e-3)


@pytest.mark.parametrize("batch", [(4,), (2, 1, 3)])
def test_a_batch_of_bends_is_its_members_one_by_one(batch):
    bends = in_single(np.random.default_rng(0).normal(size=(*batch, 2)))
    together = configurations_from_bends(bends)
    alone = [configurations_from_bends(b) for b in bends.reshape(-1, 2)]
    assert together.shape == (*batch, 3)
    np.testing.assert_allclose(together.reshape(-1, 3), alone, atol=1e-6)
    np.testing.assert_allclose(bends_from_configurations(together), bends, atol=1e-5)


def test_bends_beyond_their_limits_are_shortened_and_the_others_left_alone():
    bends = np.array([[3.0, 4.0], [0.3, -0.4], [0.0, 0.0]])
    limited = limit_lengths(bends, np.array([1.0, 1.0, 1.0]))
    np.testing.assert_allclose(limited, [[0.6, 0.8], [0.3, -0.4], [0.0, 0.0]])


@quick
@given(st.floats(0, 6.0), directions(), st.floats(0.02, 2.6))
def test_limited_bends_keep_their_direction_and_their_limit(angle, direction, limit):
    limited = limit_lengths(in_single(bend(angle, direction)), in_single(limit))
    np.testing.assert_allclose(limited, bend(min(angle, limit), direction), atol=2e-6)


def test_the_gradient_of_a_limited_bend_is_finite_at_zero():
    gradient = jax.jit(jax.jacobian(kinematics.limit_lengths))
    np.testing.assert_array_equal(gradient(np.zeros(2), np.array(0.5)), np.eye(2))


def test_cables_become_the_same_bends_in_jax_and_in_numpy():
    geometry = ArmGeometry.of(load_arm("twin_arm"))
    cables = np.random.default_rng(0).normal(size=(4, 3, 3))
    bends = kinematics.bends_from_cables(jnp.asarray(geometry.bend_matrices), cables)
    np.testing.assert_allclose(bends, geometry.bends_of(cables), atol=1e-6)
