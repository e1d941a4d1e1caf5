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
from s2c2a_experiments.tip_lstm import LSTMOptions, TipHistory

TWIN = load_arm("twin_arm")
SIMULATED = load_arm("simulated_arm")
run = eqx.filter_jit(lambda network, *inputs: network(*inputs))


def a_tip_lstm(arm, layers=1):
    model = LSTMOptions(layers, hidden=8).untrained(arm, jax.random.key(3))
    scaling = Scaling(
        jnp.asarray(numbers(5, 3)), jnp.asarray(np.abs(numbers(6, 3)) + 0.5)
    )
    bias = jnp.asarray(numbers(0, arm.module_count * arm.cable_count))
    return eqx.tree_at(
        lambda m: (m.position_scaling, m.network.bias_head), model, (scaling, bias)
    )


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


@pytest.mark.parametrize(
    ("arm", "last_layer", "layers"),
    [(TWIN, equation_10, 1), (TWIN, equation_10, 4), (SIMULATED, bend_plane, 2)],
)
def test_a_batch_through_a_tip_lstm_agrees_with_second_forward_passes(
    arm, last_layer, layers
):
    """Features of each time step: the tip, the action before, the target."""
    model = a_tip_lstm(arm, layers)
    assert len(model.network.layers) == layers
    desired, history = numbers(9, 2, 1, 3), a_history(arm, 2, 1)
    found = run(model, desired, history)
    assert found.shape == (2, 1, arm.module_count, arm.cable_count)
    for number, batch in enumerate(found):
        one = TipHistory(*(values[number, 0] for values in history))
        expected = last_layer(slow_tip_lstm(model, desired[number, 0], one))
        np.testing.assert_allclose(batch[0], expected, rtol=1e-5, atol=1e-6)


def slow_tip_lstm(model, desired, history):
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
    return slow_lstm(model.network, moments).reshape(history.actions.shape[1:])


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
