import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from s2c2a.arm import load_arm
from s2c2a.errors import StrategyError
from s2c2a.integrations.pytorch import (
    export_pytorch,
    state_of,
    with_pytorch_weights,
    with_state,
)
from s2c2a.paper import BiLSTM
from s2c2a.strategies import networks_from, save_networks


@pytest.fixture
def network() -> BiLSTM:
    return BiLSTM(3, 6, layers=2, hidden=5, key=jax.random.key(1))


def sigmoid(values):
    return 1.0 / (1.0 + np.exp(-values))


def pytorch_direction(state, place, inputs):
    """The equations of PyTorch's documentation of nn.LSTM, in NumPy."""
    hidden = np.zeros(state[f"lstm.weight_hh{place}"].shape[1])
    cell = np.zeros_like(hidden)
    outputs = []
    for row in inputs:
        gates = state[f"lstm.weight_ih{place}"] @ row + state[f"lstm.bias_ih{place}"]
        gates += state[f"lstm.weight_hh{place}"] @ hidden
        gates += state[f"lstm.bias_hh{place}"]
        i, f, g, o = np.split(gates, 4)
        cell = sigmoid(f) * cell + sigmoid(i) * np.tanh(g)
        hidden = sigmoid(o) * np.tanh(cell)
        outputs.append(hidden)
    return np.array(outputs)


def pytorch_output(state, inputs, layers):
    values = inputs
    for layer in range(layers):
        up = pytorch_direction(state, f"_l{layer}", values)
        down = pytorch_direction(state, f"_l{layer}_reverse", values[::-1])[::-1]
        values = np.concatenate([up, down], axis=-1)
    return values @ state["head.weight"].T + state["head.bias"]


def test_the_weights_mean_the_same_in_the_equations_of_pytorch(network):
    inputs = np.random.default_rng(0).normal(size=(4, 3)).astype(np.float32)
    expected = network(jnp.asarray(inputs))
    found = pytorch_output(state_of(network), inputs, layers=2)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_the_weights_mean_the_same_in_pytorch_itself(network):
    torch = pytest.importorskip("torch")
    inputs = np.random.default_rng(0).normal(size=(1, 4, 3)).astype(np.float32)
    lstm = torch.nn.LSTM(3, 5, 2, batch_first=True, bidirectional=True)
    head = torch.nn.Linear(10, 6)
    module = torch.nn.ModuleDict({"lstm": lstm, "head": head})
    state = state_of(network)
    tensors = {name: torch.tensor(values) for name, values in state.items()}
    module.load_state_dict(tensors)
    found = head(lstm(torch.tensor(inputs))[0]).detach().numpy()
    np.testing.assert_allclose(found, network(jnp.asarray(inputs)), atol=1e-6)
    trained = {name: each.numpy() for name, each in module.state_dict().items()}
    again = with_state(network, trained)
    np.testing.assert_array_equal(again(inputs[0]), network(jnp.asarray(inputs[0])))


def test_both_biases_of_pytorch_count(network):
    state = state_of(network)
    state["lstm.bias_hh_l1"] = state["lstm.bias_ih_l1"] + 0.5
    changed = with_state(network, state)
    inputs = np.ones((4, 3), np.float32)
    expected = pytorch_output(state, inputs, layers=2)
    np.testing.assert_allclose(changed(jnp.asarray(inputs)), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda state: state.pop("head.bias"), "lacks head.bias"),
        (lambda state: state.update(other=np.zeros(2)), "has other, which"),
        (lambda state: state.update({"head.bias": np.zeros(2)}), r"needs \(6,\)"),
        (lambda state: state.update({"head.bias": np.full(6, np.nan)}), "not finite"),
    ],
)
def test_weights_that_do_not_fit_are_refused(network, change, message):
    state = state_of(network)
    change(state)
    with pytest.raises(StrategyError, match=message):
        with_state(network, state)


def test_a_weight_file_goes_out_and_in(tmp_path):
    networks = networks_from("shipped", load_arm("twin_arm"))
    save_networks(networks, tmp_path / "mine.safetensors")
    out = tmp_path / "mine.pytorch"
    assert export_pytorch(tmp_path / "mine.safetensors", out).endswith("of C2A")
    arrays = load_file(out)
    save_file({name: 2.0 * values for name, values in arrays.items()}, out)
    changed = with_pytorch_weights(networks, out)
    doubled = state_of(changed.c2a.network)
    np.testing.assert_array_equal(
        doubled["head.weight"], 2.0 * arrays["C2A.head.weight"]
    )
    save_networks(changed, tmp_path / "changed.safetensors")
    save_file({"C2S.head.bias": np.zeros(2, np.float32)}, out)
    with pytest.raises(StrategyError, match="the biLSTMs of these networks are C2A"):
        with_pytorch_weights(networks, out)
    out.write_bytes(b"no safetensors")
    with pytest.raises(StrategyError, match="cannot be read as safetensors"):
        with_pytorch_weights(networks, out)
