"""Training the LSTM of the comparison, as the networks of the paper are trained."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data import Samples, Split
from s2c2a.networks import Scaling, SumAndRange
from s2c2a.networks.lstm import TipHistory, TipLSTM
from s2c2a.training.fit import FitOptions, Progress, fit
from s2c2a.training.networks import NetworkSize, Trained, batch_of, evaluated


def train_lstm(
    split: Split,
    arm: ArmSpec,
    size: NetworkSize,
    history_noise: float,
    options: FitOptions,
    key: PRNGKeyArray,
    progress: Progress = lambda *_: None,
) -> Trained[TipLSTM]:
    """Train the LSTM on what led from one tip position to the next.

    Args:
        split: samples; positions in [m], actions in [m or N].
        arm: whose cables they are.
        size: of the network.
        history_noise: standard deviation of the noise on past actions in training, normalised.
        options: how to train.
        key: for weights, order and noise.
        progress: told epoch, most epochs, validation loss.

    Raises:
        TrainingError: too few samples, or the loss is not finite.
    """
    network_key, fit_key = jax.random.split(key)
    model = TipLSTM.untrained(arm, size.layers, size.hidden, network_key)
    model = TipLSTM(model.network, Scaling.of(split.training.inputs["wanted"]), model.sum_and_range)
    parts = (split.training, split.validation, split.test)
    scaled = Split(*(_normalised(part, model.sum_and_range) for part in parts))

    def loss(model: TipLSTM, batch: dict[str, Array], key) -> Array:
        noise = 0.0 if key is None else history_noise * jax.random.normal(key, batch["actions"].shape)
        return jnp.mean((_answer(model, batch | {"actions": batch["actions"] + noise}) - batch["targets"]) ** 2)

    result = fit(model, loss, batch_of(scaled.training), batch_of(scaled.validation), options, fit_key, progress)
    return evaluated(result, _answer, scaled)


def _answer(model: TipLSTM, batch: dict[str, Array]) -> Array:
    return model(batch["wanted"], TipHistory(batch["positions"], batch["actions"]))


def _normalised(samples: Samples, layer: SumAndRange) -> Samples:
    """Actions in the network's units."""
    past, taken = (layer.normalised(jnp.asarray(values)) for values in (samples.inputs["actions"], samples.targets))
    return Samples(samples.inputs | {"actions": np.asarray(past)}, np.asarray(taken))
