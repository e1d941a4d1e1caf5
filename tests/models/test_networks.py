"""C2S, C2A and their biLSTM, against second implementations in float64."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from by_hand import bend_plane, equation_10, numbers, sigmoid
from s2c2a.arm import load_arm
from s2c2a.control import C2AOptions
from s2c2a.models import C2SOptions, History
from s2c2a.models.layers import Scaling
from s2c2a.paper import BiLSTM, module_labels
from s2c2a.training.fit import held

from marks import slow_after

TWIN = load_arm("twin_arm")
SIMULATED = load_arm("simulated_arm")
run = eqx.filter_jit(lambda network, *inputs: network(*inputs))
predict = eqx.filter_jit(
    lambda model, configurations: model.predict(configurations, ())
)


def affine(seed, features):
    """A scaling of random center and range."""
    return Scaling(
        jnp.asarray(numbers(seed, features)),
        jnp.asarray(np.abs(numbers(seed + 1, features)) + 0.5),
    )


def slow_direction(layer, inputs, order):
    """One LSTM along the modules in the given order, in float64, gate by gate."""
    to_gates, back, bias = (
        np.asarray(w, np.float64)
        for w in (layer.weight_input, layer.weight_hidden, layer.bias)
    )
    width = back.shape[0]
    hidden, cell, outputs = np.zeros(width), np.zeros(width), {}
    for module in order:
        gates = inputs[module] @ to_gates + hidden @ back + bias
        take, keep, candidate, show = (
            gates[gate * width : (gate + 1) * width] for gate in range(4)
        )
        cell = sigmoid(keep) * cell + sigmoid(take) * np.tanh(candidate)
        hidden = sigmoid(show) * np.tanh(cell)
        outputs[module] = hidden
    return [outputs[module] for module in range(len(inputs))]


def slow_bilstm(network, inputs):
    """A second biLSTM, module by module, in float64."""
    values, count = np.asarray(inputs, np.float64), len(inputs)
    for up, down in network.layers:
        rising = slow_direction(up, values, range(count))
        falling = slow_direction(down, values, range(count - 1, -1, -1))
        values = [np.concatenate(pair) for pair in zip(rising, falling, strict=True)]
    head = np.asarray(network.weight_head, np.float64)
    bias = np.asarray(network.bias_head, np.float64)
    return np.array([value @ head + bias for value in values])


def a_bilstm(seed=0, features=3, outputs=5, layers=2, hidden=8):
    network = BiLSTM(features, outputs, layers, hidden, jax.random.key(seed))
    return eqx.tree_at(
        lambda n: n.bias_head, network, jnp.asarray(numbers(seed, outputs))
    )


def a_c2s():
    model = C2SOptions(layers=1, hidden=8).untrained(TWIN, jax.random.key(1))
    return eqx.tree_at(
        lambda m: (m.configuration_scaling, m.state_scaling),
        model,
        (affine(2, 3), affine(4, 6)),
    )


def a_c2a(arm):
    model = C2AOptions(layers=1, hidden=8).untrained(arm, jax.random.key(3))
    return eqx.tree_at(lambda m: m.configuration_scaling, model, affine(5, 3))


def a_history(cables, *batch, modules=3):
    return History(
        numbers(6, *batch, modules, 4, 3), numbers(7, *batch, modules, 5, cables)
    )


@pytest.mark.parametrize(
    ("modules", "layers"),
    slow_after(2, [(1, 1), (3, 2), (2, 1), (4, 1), (6, 1), (3, 4)]),
)
def test_a_bilstm_agrees_with_a_second_one_for_any_size(modules, layers):
    network, inputs = a_bilstm(layers=layers), numbers(1, modules, 3)
    assert len(network.layers) == layers
    np.testing.assert_allclose(
        run(network, inputs), slow_bilstm(network, inputs), rtol=1e-5, atol=1e-6
    )


def test_the_directions_of_a_layer_start_apart():
    up, down = a_bilstm().layers[0]
    assert (
        np.abs(np.asarray(up.weight_input) - np.asarray(down.weight_input)).max() > 0.01
    )


def test_c2s_agrees_with_a_second_forward_pass():
    model, configurations = a_c2s(), numbers(8, 3, 3)
    into, out = model.configuration_scaling, model.state_scaling
    scaled = (configurations - np.asarray(into.center)) / np.asarray(into.half_range)
    states = slow_bilstm(model.network, scaled) * np.asarray(
        out.half_range
    ) + np.asarray(out.center)
    np.testing.assert_allclose(
        predict(model, configurations), states, rtol=1e-5, atol=1e-6
    )


@pytest.mark.parametrize("modules", slow_after(1, [1, 6]))
def test_c2s_takes_any_module_count_and_batch(modules):
    model, configurations = a_c2s(), numbers(9, 2, 3, modules, 3)
    together = predict(model, configurations)
    assert together.shape == (2, 3, modules, 6)
    alone = [predict(model, one) for one in configurations.reshape(-1, modules, 3)]
    np.testing.assert_allclose(
        together.reshape(-1, modules, 6), alone, rtol=1e-5, atol=1e-6
    )


@pytest.mark.parametrize(
    ("modules", "labels"),
    [(1, [0]), (2, [-1, 1]), (3, [-1, 0, 1]), (5, [-1, -0.5, 0, 0.5, 1])],
)
def test_module_labels_are_equation_9_and_zero_for_a_single_module(modules, labels):
    np.testing.assert_allclose(module_labels(modules), labels, atol=1e-7)


def slow_c2a(model, desired, history, last_layer):
    """Eq. (8), features in order: desired; C_t to C_t-3; A_t-1 to A_t-5; label."""
    scaling = model.configuration_scaling
    center, half = np.asarray(scaling.center), np.asarray(scaling.half_range)
    rows = []
    for module in range(len(desired)):
        configurations = [
            (history.configurations[module, age] - center) / half for age in range(4)
        ]
        actions = [history.actions[module, age] for age in range(5)]
        label = [2 * module / (len(desired) - 1) - 1]
        rows.append(
            np.concatenate(
                [(desired[module] - center) / half, *configurations, *actions, label]
            )
        )
    return last_layer(slow_bilstm(model.network, np.array(rows)))


@pytest.mark.parametrize(
    ("arm", "last_layer"), [(TWIN, equation_10), (SIMULATED, bend_plane)]
)
def test_c2a_agrees_with_a_second_forward_pass(arm, last_layer):
    model, desired, history = a_c2a(arm), numbers(10, 3, 3), a_history(arm.cable_count)
    expected = slow_c2a(model, desired, history, last_layer)
    np.testing.assert_allclose(
        run(model, desired, history), expected, rtol=1e-5, atol=1e-6
    )


@pytest.mark.parametrize("modules", slow_after(1, [1, 6]))
def test_c2a_takes_any_module_count(modules):
    arm = TWIN.model_copy(update={"modules": TWIN.modules[:1] * modules})
    actions = run(a_c2a(arm), numbers(12, modules, 3), a_history(3, modules=modules))
    assert actions.shape == (modules, 3)
    assert np.isfinite(actions).all()


def test_training_cannot_move_the_scalings():
    model = a_c2a(TWIN)
    desired = numbers(13, 3, 3)
    history = a_history(3)
    gradient = eqx.filter_jit(
        eqx.filter_grad(lambda m: jnp.sum(held(m)(desired, history) ** 2))
    )(model)
    fixed = jax.tree.leaves((gradient.configuration_scaling, gradient.sum_and_range))
    assert all(not np.any(leaf) for leaf in fixed)
    assert all(np.any(leaf) for leaf in jax.tree.leaves(gradient.network))
