import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from s2c2a import kinematics
from s2c2a.arm import load_arm
from s2c2a.models.forward_model import PCCForwardModel

configurations_from_bends = jax.jit(kinematics.configurations_from_bends)
states_from_bends = jax.jit(kinematics.states_from_bends)
states_from_configurations = jax.jit(kinematics.states_from_configurations)
configurations_from_states = jax.jit(kinematics.configurations_from_states)
gradient_of_states = jax.jit(jax.jacobian(kinematics.states_from_bends))
quick = settings(deadline=None, max_examples=30)
LENGTHS = np.array([0.2, 0.15, 0.3])


def in_single(values):
    return np.asarray(values, np.float32)


def slow_states(bends, lengths, pieces=1000):
    """States in float64, each arc walked in short straight pieces."""
    frame, position, states = Rotation.identity(), np.zeros(3), []
    middles = (np.arange(pieces) + 0.5) / pieces
    for bend, length in zip(bends, lengths, strict=True):
        # about the axis across the bend's direction
        turn = np.array([-bend[1], bend[0], 0.0])
        steps = Rotation.from_rotvec(middles[:, None] * turn).apply([0.0, 0.0, 1.0])
        position = position + frame.apply(length * steps.mean(axis=0))
        frame = frame * Rotation.from_rotvec(turn)
        states.append(np.concatenate([position, frame.apply([0.0, 0.0, 1.0])]))
    return np.array(states)


def slow_jacobian(bends, lengths, step=1e-4):
    columns = []
    for unit in np.eye(bends.size):
        change = step * unit.reshape(bends.shape)
        above, below = (slow_states(bends + c, lengths) for c in (change, -change))
        columns.append((above - below) / (2 * step))
    return np.stack(columns, axis=-1).reshape(len(lengths), 6, *bends.shape)


def bend_rows(modules=3, largest=1.5):
    rows = st.tuples(*[st.floats(-largest, largest)] * 2)
    return st.lists(rows, min_size=modules, max_size=modules).map(np.array)


def test_a_straight_arm_stands_on_its_base():
    states = states_from_bends(jnp.zeros((3, 2)), in_single(LENGTHS))
    expected = [[0, 0, height, 0, 0, 1] for height in np.cumsum(LENGTHS)]
    np.testing.assert_allclose(states, expected, atol=1e-7)


@pytest.mark.parametrize("direction", [0.0, np.pi / 2, 2.2, -1.0])
def test_a_quarter_circle_ends_its_radius_up_and_its_radius_aside(direction):
    across = np.array([np.cos(direction), np.sin(direction)])
    states = states_from_bends(in_single([np.pi / 2 * across]), jnp.array([0.2]))
    radius = 0.2 / (np.pi / 2)
    expected = [*(radius * across), radius, *across, 0.0]
    np.testing.assert_allclose(states[0], expected, atol=1e-6)


@quick
@given(st.floats(0, 2.5), st.floats(-np.pi, np.pi), st.sampled_from([2, 5]))
def test_equal_bends_are_one_big_arc(angle, direction, modules):
    across = np.array([np.cos(direction), np.sin(direction)])
    bends = in_single(np.tile(angle / modules * across, (modules, 1)))
    states = states_from_bends(bends, in_single(np.full(modules, 0.6 / modules)))
    one = states_from_bends(in_single([angle * across]), jnp.array([0.6]))
    np.testing.assert_allclose(states[-1], one[0], atol=2e-6)


def test_opposite_bends_of_two_modules_make_an_s_that_ends_upright():
    bends = jnp.array([[0.8, 0.0], [-0.8, 0.0]])
    states = states_from_bends(bends, jnp.array([0.2, 0.2]))
    x, z = 0.2 / 0.8 * np.array([1 - np.cos(0.8), np.sin(0.8)])
    expected = [[x, 0, z, np.sin(0.8), 0, np.cos(0.8)], [2 * x, 0, 2 * z, 0, 0, 1]]
    np.testing.assert_allclose(states, expected, atol=1e-6)


@quick
@given(bend_rows())
def test_states_agree_with_a_polygon_of_short_pieces(bends):
    states = states_from_bends(in_single(bends), in_single(LENGTHS))
    np.testing.assert_allclose(states, slow_states(bends, LENGTHS), atol=2e-6)


@pytest.mark.parametrize("size", [0.0, 1e-8, 1e-5, 1e-3, 0.1, 1.0])
def test_the_gradient_of_states_is_exact_at_and_near_zero(size):
    bends = size * np.array([[0.6, -0.8], [1.0, 0.0], [-0.3, 0.5]])
    found = gradient_of_states(in_single(bends), in_single(LENGTHS))
    np.testing.assert_allclose(found, slow_jacobian(bends, LENGTHS), atol=2e-5)


@quick
@given(bend_rows(largest=1.7))
def test_configurations_come_back_from_their_states(bends):
    configurations = configurations_from_bends(in_single(bends))
    states = states_from_configurations(configurations, in_single(LENGTHS))
    back = configurations_from_states(states)
    np.testing.assert_allclose(back, configurations, atol=2e-5)


@quick
@given(bend_rows())
def test_states_of_bends_and_of_their_configurations_are_the_same(bends):
    from_bends = states_from_bends(in_single(bends), in_single(LENGTHS))
    configurations = configurations_from_bends(in_single(bends))
    states = states_from_configurations(configurations, in_single(LENGTHS))
    np.testing.assert_allclose(states, from_bends, atol=2e-6)


@quick
@given(bend_rows(), st.floats(-np.pi, np.pi))
def test_turning_every_bend_turns_the_whole_arm(bends, angle):
    turn = Rotation.from_rotvec([0, 0, angle]).as_matrix()
    turned = states_from_bends(in_single(bends @ turn[:2, :2].T), in_single(LENGTHS))
    states = np.asarray(states_from_bends(in_single(bends), in_single(LENGTHS)))
    expected = np.concatenate([states[:, :3] @ turn.T, states[:, 3:] @ turn.T], axis=-1)
    np.testing.assert_allclose(turned, expected, atol=2e-6)


@pytest.mark.parametrize("batch", [(4,), (2, 3)])
def test_a_batch_of_arms_is_its_members_one_by_one(batch):
    bends = in_single(np.random.default_rng(0).uniform(-1, 1, (*batch, 3, 2)))
    states = states_from_bends(bends, in_single(LENGTHS))
    assert states.shape == (*batch, 3, 6)
    rows = bends.reshape(-1, 3, 2)
    alone = [states_from_bends(one, in_single(LENGTHS)) for one in rows]
    np.testing.assert_allclose(states.reshape(-1, 3, 6), alone, atol=1e-6)
    found = configurations_from_states(states).reshape(-1, 3, 3)
    back = [configurations_from_states(one) for one in alone]
    np.testing.assert_allclose(found, back, atol=1e-6)


@pytest.mark.parametrize("modules", [1, 12])
def test_short_and_long_arms_keep_their_precision(modules):
    bends = in_single(np.random.default_rng(0).uniform(-0.5, 0.5, (50, modules, 2)))
    lengths = np.full(modules, 0.1)
    states = states_from_bends(bends, in_single(lengths))
    exact = slow_states(bends[0].astype(float), lengths)
    np.testing.assert_allclose(states[0], exact, atol=5e-6)
    back = configurations_from_states(states)
    np.testing.assert_allclose(back, configurations_from_bends(bends), atol=5e-6)


def test_the_pcc_forward_model_uses_the_lengths_and_has_no_memory():
    model = PCCForwardModel.of(load_arm("twin_arm"))
    predict = eqx.filter_jit(model.predict)
    memory = model.start(jnp.zeros((3, 3)))
    assert memory == ()
    assert model.observe(jnp.ones((3, 3)), memory) == ()
    straight = in_single(np.tile([0.0, 0.0, 1.0], (3, 1)))
    expected = states_from_configurations(straight, model.lengths)
    np.testing.assert_allclose(predict(straight, memory), expected)
    np.testing.assert_allclose(model.lengths, 0.2)
