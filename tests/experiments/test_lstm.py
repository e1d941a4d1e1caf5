"""The LSTM over time, against a second implementation in float64."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from by_hand import bend_plane, equation_10, numbers, sigmoid
from s2c2a.arm import load_arm
from s2c2a.models.layers import Scaling
from s2c2a.training.fit import held
from s2c2a_experiments.tip_lstm import LSTM, LSTMOptions, TipHistory

TWIN = load_arm("twin_arm")
SIMULATED = load_arm("simulated_arm")
run = eqx.filter_jit(lambda network, *inputs: network(*inputs))


def an_lstm(seed=0, features=4, outputs=5, layers=2, hidden=8):
    network = LSTM(features, outputs, layers, hidden, jax.random.key(seed))
    return eqx.tree_at(
        lambda n: n.bias_head, network, jnp.asarray(numbers(seed, outputs))
    )


def a_tip_lstm(arm, layers=1):
    model = LSTMOptions(layers, hidden=8).untrained(arm, jax.random.key(3))
    scaling = Scaling(
        jnp.asarray(numbers(5, 3)), jnp.asarray(np.abs(numbers(6, 3)) + 0.5)
    )
    return eqx.tree_at(lambda m: m.position_scaling, model, scaling)


def a_history(arm, *batch):
    return TipHistory(
        numbers(7, *batch, 5, 3),
        numbers(8, *batch, 5, arm.module_count, arm.cable_count),
    )


def slow_lstm(network, inputs):
    """A second LSTM in float64, step by step and gate by gate, oldest step first."""
    values = [np.asarray(moment, np.float64) for moment in inputs]
    for layer in network.layers:
        into, back, bias = (
            np.asarray(w, np.float64)
            for w in (layer.weight_input, layer.weight_hidden, layer.bias)
        )
        hidden = np.zeros(len(back))
        cell = np.zeros(len(back))
        outputs = []
        for moment in values:
            input_gate, forget_gate, candidate, output_gate = np.split(
                moment @ into + hidden @ back + bias, 4
            )
            cell = sigmoid(forget_gate) * cell + sigmoid(input_gate) * np.tanh(
                candidate
            )
            hidden = sigmoid(output_gate) * np.tanh(cell)
            outputs.append(hidden)
        values = outputs
    return values[-1] @ np.asarray(network.weight_head, np.float64) + np.asarray(
        network.bias_head, np.float64
    )


@pytest.mark.parametrize(("layers", "moments"), [(1, 1), (1, 5), (2, 5), (4, 3)])
def test_an_lstm_agrees_with_a_second_one_for_any_depth_and_time(layers, moments):
    network, inputs = an_lstm(layers=layers), numbers(0, moments, 4)
    assert len(network.layers) == layers
    np.testing.assert_allclose(
        run(network, inputs), slow_lstm(network, inputs), rtol=1e-5, atol=1e-6
    )


@pytest.mark.parametrize("batch", [(4,), (2, 3)])
def test_a_batch_through_an_lstm_equals_single_calls(batch):
    network, inputs = an_lstm(), numbers(1, *batch, 5, 4)
    together = run(network, inputs)
    assert together.shape == (*batch, 5)
    alone = [run(network, one) for one in inputs.reshape(-1, 5, 4)]
    np.testing.assert_allclose(together.reshape(-1, 5), alone, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("arm", "last_layer"), [(TWIN, equation_10), (SIMULATED, bend_plane)]
)
def test_a_tip_lstm_agrees_with_a_second_forward_pass(arm, last_layer):
    """Features of each time step: the tip, the action before, the target."""
    model = a_tip_lstm(arm, layers=2)
    desired = numbers(9, 3)
    history = a_history(arm)
    center, half = (
        np.asarray(part)
        for part in (model.position_scaling.center, model.position_scaling.half_range)
    )
    moments = [
        np.concatenate(
            [(position - center) / half, action.ravel(), (desired - center) / half]
        )
        for position, action in zip(*history, strict=True)
    ]
    expected = last_layer(
        slow_lstm(model.network, moments).reshape(arm.module_count, arm.cable_count)
    )
    np.testing.assert_allclose(
        run(model, desired, history), expected, rtol=1e-5, atol=1e-6
    )


def test_training_cannot_move_the_scalings_of_a_tip_lstm():
    model = a_tip_lstm(TWIN)
    desired = numbers(13, 3)
    history = a_history(TWIN)
    gradient = eqx.filter_jit(
        eqx.filter_grad(lambda m: jnp.sum(held(m)(desired, history) ** 2))
    )(model)
    fixed = jax.tree.leaves((gradient.position_scaling, gradient.sum_and_range))
    assert all(not np.any(leaf) for leaf in fixed)
    assert all(np.any(leaf) for leaf in jax.tree.leaves(gradient.network))
