"""A model trained on samples, and how well it does on those that it has not seen."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PRNGKeyArray

from s2c2a.data import Samples, Split
from s2c2a.training.errors import full_ranges, percent_error
from s2c2a.training.fit import Batch, FitOptions, Loss, Network, Progress, fit

Model = TypeVar("Model", bound=eqx.Module, covariant=True)


@dataclass(frozen=True)
class Trained(Generic[Model]):
    """A trained model.

    Attributes:
        network: the model.
        curve: rows of epoch, training loss, validation loss.
        percent: mean and standard deviation of the held-out error, in percent of full range.
    """

    network: Model
    curve: np.ndarray
    percent: tuple[float, float]


def train(
    model: Network,
    loss: Loss[Network],
    answer: Callable[[Network, Batch], Array],
    split: Split,
    options: FitOptions,
    key: PRNGKeyArray,
    progress: Progress,
) -> Trained[Network]:
    """Train a model on samples and try it on those held out.

    Args:
        model: to begin from.
        loss: (model, batch, key) -> mean loss of the batch; the key is None when validating.
        answer: (model, batch) -> what compares with the targets of the batch.
        split: samples.
        options: how to train.
        key: for the order of samples and for the loss.
        progress: told epoch, most epochs, validation loss.

    Raises:
        TrainingError: too few samples, or the loss is not finite.
    """
    result = fit(model, loss, _batch(split.training), _batch(split.validation), options, key, progress)
    predicted = np.asarray(eqx.filter_jit(answer)(result.network, _batch(split.test)))
    targets = [part.targets for part in (split.training, split.validation, split.test)]
    percent = percent_error(predicted, split.test.targets, full_ranges(np.concatenate(targets)))
    return Trained(result.network, result.curve, percent)


def with_noise(batch: Batch, deviation: float, key: PRNGKeyArray | None) -> Batch:
    """The batch with noise on its past actions; without, when validating.

    A network that sees its own past unspoilt learns to repeat it, and diverges in closed loop (docs/deviations.md).
    """
    if key is None:
        return batch
    return batch | {"actions": batch["actions"] + deviation * jax.random.normal(key, batch["actions"].shape)}


def _batch(samples: Samples) -> Batch:
    """Inputs and targets together, as the training loop takes them."""
    return {name: jnp.asarray(values) for name, values in (samples.inputs | {"targets": samples.targets}).items()}
