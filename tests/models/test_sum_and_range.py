import jax
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import cable_layouts
from by_hand import bend_plane
from cable_layouts import even, layouts
from s2c2a.arm import ArmGeometry
from s2c2a.models.layers import HEADROOM, SumAndRange

quick = settings(deadline=None, max_examples=30)
directions = st.floats(-np.pi, np.pi)
_apply = jax.jit(lambda layer, raw: layer(raw))
_jacobian = jax.jit(lambda layer, raw: jax.jacobian(layer)(raw))


def arm_of(angles, actuation="displacement"):
    values = {"bend_limit_deg": 60.0, "pretension": 20.0, "tension_range": 12.0}
    return cable_layouts.arm_of(angles, actuation, cable_radius=0.03, **values)


def applied(angles, raw):
    """Normalized actions of one module with these cables, in float64."""
    raw = np.resize(np.asarray(raw, np.float32), (1, len(angles)))
    return np.asarray(_apply(SumAndRange.of(arm_of(angles)), raw), np.float64)[0]


def cable_matrix(angles):
    radians = np.deg2rad(angles)
    return -np.stack([np.cos(radians), np.sin(radians)], axis=-1)


raw_outputs = st.lists(st.floats(-50, 50), min_size=8, max_size=8)


def test_equation_10_reaches_one_where_one_cable_is_against_the_others():
    np.testing.assert_allclose(
        applied(even(3), [50.0, -50.0, -50.0]), [1.0, -0.5, -0.5], atol=1e-6
    )


@quick
@given(st.integers(3, 8), st.floats(-180, 180), raw_outputs)
def test_actions_of_even_cables_stay_in_range_and_sum_to_zero(cables, offset, raw):
    actions = applied(even(cables, offset), raw)
    assert np.abs(actions).max() <= 1 + 1e-6
    assert actions.sum() == pytest.approx(0.0, abs=2e-6)


@quick
@given(layouts(), raw_outputs)
def test_actions_of_any_cables_stay_in_range_and_do_nothing_but_bend(angles, raw):
    actions, matrix = applied(angles, raw), cable_matrix(angles)
    assert np.abs(actions).max() <= 1 + 1e-6
    np.testing.assert_allclose(
        matrix @ np.linalg.pinv(matrix) @ actions, actions, atol=3e-6
    )


@quick
@given(st.floats(-180, 180), st.floats(0, 1), directions)
def test_three_even_cables_reach_every_bend_up_to_the_full_one(
    offset, share, direction
):
    """Inverse of eq. (10): tanh t = 4 A / 3 + c, with c in the middle of its range."""
    angles = even(3, offset)
    desired = (
        cable_matrix(angles)
        @ [share * np.cos(direction), share * np.sin(direction)]
        / HEADROOM
    )
    squashed = 4 / 3 * desired - 2 / 3 * (desired.max() + desired.min())
    assert np.abs(squashed).max() < 0.95
    np.testing.assert_allclose(
        applied(angles, np.arctanh(squashed)), desired, atol=2e-6
    )


@quick
@given(layouts(), st.floats(1e-6, 1), directions)
def test_any_cables_reach_every_bend_up_to_the_full_one(angles, share, direction):
    matrix = cable_matrix(angles)
    towards = np.array([np.cos(direction), np.sin(direction)])
    assume(not SumAndRange.of(arm_of(angles)).evenly_three)
    raw = matrix @ towards * np.arctanh(share / HEADROOM)
    np.testing.assert_allclose(
        applied(angles, raw), matrix @ towards * share / HEADROOM, atol=3e-6
    )


@pytest.mark.parametrize(
    ("angles", "slope"),
    [(even(3), 0.75), ((0.0, 100.0, 220.0), 1), (even(4), 1), (even(8), 1)],
)
def test_raw_zero_is_exactly_rest_with_an_exact_gradient(angles, slope):
    """Eq. (10) is 3/4 of the projection I - 1 1^T / 3 there."""
    layer, zero = SumAndRange.of(arm_of(angles)), np.zeros((1, len(angles)), np.float32)
    matrix = cable_matrix(angles)
    projection = slope * matrix @ np.linalg.pinv(matrix)
    np.testing.assert_array_equal(_apply(layer, zero), zero)
    np.testing.assert_allclose(_jacobian(layer, zero)[0, :, 0], projection, atol=1e-6)


@pytest.mark.parametrize("size", [1e-20, 1e-8, 1e-4, 9e-4, 1e-3, 1.1e-3, 0.1, 5.0, 1e4])
def test_values_and_gradients_are_right_at_any_size(size):
    raw, step = size * np.array([[0.5, -1.0, 0.2, 0.4]]), 1e-4 * max(size, 0.1)
    layer = SumAndRange.of(arm_of(even(4)))
    np.testing.assert_allclose(
        _apply(layer, raw.astype(np.float32)), bend_plane(raw), rtol=2e-6, atol=1e-30
    )
    columns = [
        (bend_plane(raw + step * unit) - bend_plane(raw - step * unit))[0] / (2 * step)
        for unit in np.eye(4)
    ]
    jacobian = _jacobian(layer, raw.astype(np.float32))[0, :, 0]
    np.testing.assert_allclose(jacobian, np.stack(columns, axis=-1), atol=2e-5)


@pytest.mark.parametrize("actuation", ["displacement", "tension"])
@pytest.mark.parametrize("angles", [even(3), even(4), (0.0, 100.0, 220.0)])
def test_a_normalized_one_is_the_full_action_and_its_headroom(angles, actuation):
    arm = arm_of(angles, actuation)
    layer, geometry = SumAndRange.of(arm), ArmGeometry.of(arm)
    full = {"displacement": 0.03 * np.pi / 3, "tension": -12.0}[actuation]
    np.testing.assert_allclose(
        layer.actions(np.zeros_like(geometry.action_neutral)), geometry.action_neutral
    )
    difference = (
        layer.actions(np.ones_like(geometry.action_neutral)) - geometry.action_neutral
    )
    np.testing.assert_allclose(difference, HEADROOM * full, rtol=1e-5)


@pytest.mark.parametrize("actuation", ["displacement", "tension"])
def test_actions_come_back_from_their_normalization(actuation):
    layer = SumAndRange.of(arm_of(even(5), actuation))
    normalized = (
        np.random.default_rng(0).uniform(-1, 1, (2, 3, 1, 5)).astype(np.float32)
    )
    np.testing.assert_allclose(
        layer.normalized(layer.actions(normalized)), normalized, atol=1e-5
    )


def test_limited_actions_are_within_the_range_of_the_arm():
    """With 12 N around 20 N a normalized 1 is 15 N, so 0.8 is the limit."""
    layer = SumAndRange.of(arm_of(even(4), "tension"))
    limited = layer.limited(np.array([[1.0, -1.0, 0.5, -0.79]], np.float32))
    np.testing.assert_allclose(limited, [[0.8, -0.8, 0.5, -0.79]], atol=1e-6)
