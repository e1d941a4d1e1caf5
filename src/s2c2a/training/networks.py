"""Training the two networks of the paper."""

from dataclasses import dataclass
from typing import Generic

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data import Samples, Split
from s2c2a.errors import TrainingError
from s2c2a.networks import C2A, C2S, History, Scaling
from s2c2a.training.errors import full_ranges, percent_error
from s2c2a.training.fit import FitOptions, FitResult, Network, Progress, fit

MOST_LAYERS, MOST_HIDDEN = 32, 4096


@dataclass(frozen=True)
class NetworkSize:
    """Layers and hidden states of each direction (Chen et al. 2025, table II)."""

    layers: int
    hidden: int

    def __post_init__(self):
        """Refuse what cannot be built."""
        if not (1 <= self.layers <= MOST_LAYERS and 1 <= self.hidden <= MOST_HIDDEN):
            raise TrainingError(
                f"a network of {self.layers} layers and {self.hidden} hidden states was asked for; take 1 to "
                f"{MOST_LAYERS} layers and 1 to {MOST_HIDDEN} hidden states"
            )


@dataclass(frozen=True)
class Trained(Generic[Network]):
    """A trained network.

    Attributes:
        network: C2S, C2A or TipLSTM.
        curve: rows of epoch, training loss, validation loss.
        percent: mean and standard deviation of the held-out error, in percent of full range.
    """

    network: Network
    curve: np.ndarray
    percent: tuple[float, float]


def length_scale(states: np.ndarray) -> float:
    """Half the widest extent of all module ends [m]: the one scale of x, y and z, so that spheres stay spheres."""
    positions = states[..., :3].reshape(-1, 3)
    return float(np.ptp(positions, axis=0).max() / 2)


def state_scaling(states: np.ndarray) -> Scaling:
    """Positions by the one length scale about their centre, axes as they are."""
    positions = states[..., :3].reshape(-1, 3)
    centre = (positions.min(axis=0) + positions.max(axis=0)) / 2
    half = [length_scale(states)] * 3 + [1.0] * 3
    return Scaling(jnp.array([*centre, 0.0, 0.0, 0.0], dtype=jnp.float32), jnp.array(half, dtype=jnp.float32))


def train_c2s(
    split: Split, size: NetworkSize, options: FitOptions, key: PRNGKeyArray, progress: Progress = lambda *_: None
) -> Trained[C2S]:
    """Train the forward model on sensed configurations and true states.

    Raises:
        TrainingError: too few samples, or the loss is not finite.
    """
    network_key, fit_key = jax.random.split(key)
    model = C2S.untrained(size.layers, size.hidden, network_key)
    scalings = (Scaling.of(split.training.inputs["configurations"]), state_scaling(split.training.targets))
    model = C2S(model.network, *scalings)

    def loss(model: C2S, batch: dict[str, Array], key) -> Array:
        error = model.predict(batch["configurations"], ()) - batch["targets"]
        return jnp.mean((error / jax.lax.stop_gradient(model.state_scaling.half_range)) ** 2)

    result = fit(model, loss, batch_of(split.training), batch_of(split.validation), options, fit_key, progress)
    return evaluated(result, lambda model, batch: model.predict(batch["configurations"], ()), split)


def train_c2a(
    split: Split,
    arm: ArmSpec,
    size: NetworkSize,
    history_noise: float,
    options: FitOptions,
    key: PRNGKeyArray,
    progress: Progress = lambda *_: None,
) -> Trained[C2A]:
    """Train the controller on what led from one sensed configuration to the next.

    Args:
        split: samples; actions in [m or N].
        arm: whose cables they are.
        size: of the network.
        history_noise: standard deviation of the noise on past actions in training, normalised. Without it the network
            learns to repeat its last action and diverges in closed loop (docs/deviations.md).
        options: how to train.
        key: for weights, order and noise.
        progress: told epoch, most epochs, validation loss.

    Raises:
        TrainingError: too few samples, or the loss is not finite.
    """
    network_key, fit_key = jax.random.split(key)
    model = C2A.untrained(arm, size.layers, size.hidden, network_key)
    model = C2A(model.network, Scaling.of(split.training.inputs["wanted"]), model.sum_and_range)
    layer = model.sum_and_range
    scaled = Split(*(_normalised(part, layer) for part in (split.training, split.validation, split.test)))

    def loss(model: C2A, batch: dict[str, Array], key) -> Array:
        actions = batch["actions"]
        if key is not None:
            actions = actions + history_noise * jax.random.normal(key, actions.shape)
        predicted = model(batch["wanted"], History(batch["configurations"], actions))
        return jnp.mean((predicted - batch["targets"]) ** 2)

    result = fit(model, loss, batch_of(scaled.training), batch_of(scaled.validation), options, fit_key, progress)
    return evaluated(result, lambda m, b: m(b["wanted"], History(b["configurations"], b["actions"])), scaled)


def _normalised(samples: Samples, layer) -> Samples:
    """Actions in the network's units; the ages axis of past actions goes last while the layer's arrays are used."""
    past = jnp.moveaxis(layer.normalised(jnp.moveaxis(samples.inputs["actions"], -2, 0)), 0, -2)
    inputs = samples.inputs | {"actions": np.asarray(past)}
    return Samples(inputs, np.asarray(layer.normalised(samples.targets)))


def batch_of(samples: Samples) -> dict[str, Array]:
    """Inputs and targets together, as the training loop takes them."""
    return {name: jnp.asarray(values) for name, values in (samples.inputs | {"targets": samples.targets}).items()}


def evaluated(result: FitResult[Network], predict, split: Split) -> Trained[Network]:
    """A trained network with its held-out error; `predict` maps (network, batch) to what compares with the targets."""
    predicted = np.asarray(eqx.filter_jit(predict)(result.network, batch_of(split.test)))
    targets = [part.targets for part in (split.training, split.validation, split.test)]
    percent = percent_error(predicted, split.test.targets, full_ranges(np.concatenate(targets)))
    return Trained(result.network, result.curve, percent)
