"""Weights of the paper's networks in PyTorch's form, out and in.

A biLSTM is `torch.nn.LSTM(features, hidden, layers, batch_first=True,
bidirectional=True)` along the modules, and a `torch.nn.Linear` head. PyTorch itself is
not needed: state dictionaries are arrays by name, in safetensors files.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

from s2c2a.errors import StrategyError
from s2c2a.files import atomic_write
from s2c2a.paper import BiLSTM
from s2c2a.strategies import TrainedNetworks, load_networks

LSTM, HEAD = "lstm.", "head."
"""Beginnings of names, which are attributes of a PyTorch module."""
DIRECTIONS = "", "_reverse"
"""Endings of names in `nn.LSTM`, up and down the modules."""

State = dict[str, np.ndarray]


def export_pytorch(file: Path, out: Path) -> str:
    """Write the biLSTMs of a weight file as PyTorch's state dictionaries.

    Args:
        file: weights, such as mine.safetensors.
        out: a safetensors file, such as mine.pytorch, with names such as
            `C2A.lstm.weight_ih_l0`.

    Returns:
        What was written.

    Raises:
        StrategyError: no weight file, or none of its networks is a biLSTM.
    """
    networks = load_networks(file).networks
    found = {name: _bilstm_of(network) for name, network in networks.items()}
    states = {
        f"{name}.{key}": values
        for name, network in found.items()
        if network is not None
        for key, values in state_of(network).items()
    }
    if not states:
        raise StrategyError(
            f"{file} has no biLSTM, but {', '.join(networks)}; those of the recipe "
            "'paper' are some"
        )
    with atomic_write(out) as part:
        part.write_bytes(save(states))
    return f"{len(states)} arrays of {', '.join(n for n, b in found.items() if b)}"


def state_of(network: BiLSTM) -> State:
    """The state dictionary of a biLSTM.

    PyTorch has two biases, of which the second is zero here.
    """
    state = {}
    for number, directions in enumerate(network.layers):
        for direction, ending in zip(directions, DIRECTIONS, strict=True):
            place = f"_l{number}{ending}"
            bias = np.array(direction.bias, np.float32)
            state[f"{LSTM}weight_ih{place}"] = _transposed(direction.weight_input)
            state[f"{LSTM}weight_hh{place}"] = _transposed(direction.weight_hidden)
            state[f"{LSTM}bias_ih{place}"] = bias
            state[f"{LSTM}bias_hh{place}"] = np.zeros_like(bias)
    state[f"{HEAD}weight"] = _transposed(network.weight_head)
    state[f"{HEAD}bias"] = np.array(network.bias_head, np.float32)
    return state


def with_state(network: BiLSTM, state: Mapping[str, np.ndarray]) -> BiLSTM:
    """The biLSTM with the weights of a state dictionary; both biases are added.

    Raises:
        StrategyError: a name is missing or unknown, a shape differs, or a number is not
            finite.
    """
    _check_state(state, state_of(network))
    arrays: list[np.ndarray] = []
    for number in range(len(network.layers)):
        for ending in DIRECTIONS:
            place = f"_l{number}{ending}"
            bias = state[f"{LSTM}bias_ih{place}"] + state[f"{LSTM}bias_hh{place}"]
            arrays += [
                state[f"{LSTM}weight_ih{place}"].T,
                state[f"{LSTM}weight_hh{place}"].T,
                bias,
            ]
    arrays += [state[f"{HEAD}weight"].T, state[f"{HEAD}bias"]]
    weights = [jnp.asarray(array, jnp.float32) for array in arrays]
    return eqx.tree_at(_weights_of, network, weights)


def _weights_of(network: BiLSTM) -> list[Any]:
    """All weights, in the order of the layers, the head last."""
    weights = []
    for directions in network.layers:
        for direction in directions:
            weights += [direction.weight_input, direction.weight_hidden, direction.bias]
    return [*weights, network.weight_head, network.bias_head]


def with_pytorch_weights(networks: TrainedNetworks, file: Path) -> TrainedNetworks:
    """Trained networks with the weights of a file in the form of `export_pytorch`.

    Scalings and all networks that the file does not name stay.

    Args:
        networks: to change; `save_networks` saves the result.
        file: safetensors, with names such as `C2A.lstm.weight_ih_l0`.

    Raises:
        StrategyError: the file cannot be read, names a network that is no biLSTM, or
            does not fit.
    """
    try:
        arrays = load_file(file)
    except (OSError, SafetensorError) as error:
        raise StrategyError(f"{file} cannot be read as safetensors: {error}") from error
    changed = dict(networks.networks)
    for name in dict.fromkeys(key.partition(".")[0] for key in arrays):
        old = _bilstm_of(changed.get(name))
        if old is None:
            raise StrategyError(
                f"{file} names the network '{name}'; the biLSTMs of these networks are "
                f"{', '.join(n for n, each in changed.items() if _bilstm_of(each))}"
            )
        start = f"{name}."
        state = {
            key.removeprefix(start): values
            for key, values in arrays.items()
            if key.startswith(start)
        }
        new = with_state(old, state)
        changed[name] = eqx.tree_at(lambda each: each.network, changed[name], new)
    return replace(networks, networks=changed)


def _bilstm_of(network: Any) -> BiLSTM | None:
    inner = getattr(network, "network", None)
    return inner if isinstance(inner, BiLSTM) else None


def _check_state(state: Mapping[str, np.ndarray], expected: State) -> None:
    if missing := sorted(expected.keys() - state.keys()):
        raise StrategyError(f"the state dictionary lacks {', '.join(missing)}")
    if unknown := sorted(state.keys() - expected.keys()):
        raise StrategyError(
            f"the state dictionary has {', '.join(unknown)}, which this network has not; "
            "layers and features must be the same"
        )
    for name, values in expected.items():
        given = state[name]
        if given.shape != values.shape:
            raise StrategyError(
                f"{name} has shape {given.shape}; this network needs {values.shape}"
            )
        if not np.isfinite(given).all():
            raise StrategyError(f"{name} has numbers that are not finite")


def _transposed(weights: Any) -> np.ndarray:
    return np.ascontiguousarray(np.asarray(weights, np.float32).T)
