"""What a model learns from, and how well it does, once trained, on samples that it has not seen."""

from collections.abc import Callable
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data import Samples, Split
from s2c2a.training.fit import (
    Batch,
    FitOptions,
    FitResult,
    Loss,
    Model,
    Network,
    Progress,
    fit,
)


@dataclass(frozen=True)
class TrainingData:
    """Whole episodes of one arm, each begun at rest.

    Attributes:
        arm: the arm.
        sensed: configurations as they were sensed.
        actions: as really sent [m or N].
        states: true ones of the same moments [m, 1], base frame; NaN where they are not
            known.
        lengths: samples of each episode, where they differ; what is behind them counts
            nothing.
        displacements: of the cables, in parts of their radius [rad], where they also
            moved together, which no configuration says.
    """

    arm: ArmSpec
    sensed: Float[np.ndarray, "episodes samples modules 3"]
    actions: Float[np.ndarray, "episodes samples modules cables"]
    states: Float[np.ndarray, "episodes samples modules 6"]
    lengths: tuple[int, ...] | None = None
    displacements: Float[np.ndarray, "episodes samples modules cables"] | None = None


@dataclass(frozen=True)
class Trained(FitResult[Model]):
    """A trained model, how it got there, and how well it does.

    Attributes:
        network: the model.
        curve: rows of epoch, training loss, validation loss.
        percent: mean and standard deviation of the held-out error, in percent of full
            range.
    """

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
        loss: (model, batch, key) -> mean loss of the batch; the key is None when
            validating.
        answer: (model, batch) -> what compares with the targets of the batch.
        split: samples.
        options: how to train.
        key: for the order of samples and for the loss.
        progress: told epoch, most epochs, validation loss.

    Raises:
        TrainingError: too few samples, or the loss is not finite.
    """
    result = fit(
        model,
        loss,
        as_batch(split.training),
        as_batch(split.validation),
        options,
        key,
        progress,
    )
    return tried(result, answer, split)


def tried(
    result: FitResult[Network], answer: Callable[[Network, Batch], Array], split: Split
) -> Trained[Network]:
    """A fitted model and how well it does on what was held out."""
    predicted = np.asarray(eqx.filter_jit(answer)(result.network, as_batch(split.test)))
    targets = [part.targets for part in (split.training, split.validation, split.test)]
    percent = percent_error(
        predicted, split.test.targets, full_ranges(np.concatenate(targets))
    )
    return Trained(result.network, result.curve, percent)


def known_error(answer: Array, targets: Array) -> Array:
    """What an answer is wrong by, nothing where the truth is not known (NaN)."""
    known = jnp.isfinite(targets)
    return jnp.where(known, answer - jnp.where(known, targets, 0.0), 0.0)


def as_batch(samples: Samples) -> Batch:
    """Inputs and targets together, as the training loop takes them."""
    return {
        name: jnp.asarray(values)
        for name, values in (samples.inputs | {"targets": samples.targets}).items()
    }


def percent_error(
    predicted: Float[np.ndarray, "samples modules outputs"],
    true: Float[np.ndarray, "samples modules outputs"],
    ranges: Float[np.ndarray, "modules outputs"],
) -> tuple[float, float]:
    """Mean and standard deviation of |error| over samples and known outputs, in percent of each one's full range."""
    percent = (100.0 * np.abs(predicted - true) / ranges)[np.isfinite(true)]
    return float(percent.mean()), float(percent.std())


def full_ranges(
    values: Float[np.ndarray, "samples modules outputs"],
) -> Float[np.ndarray, "modules outputs"]:
    """Largest less smallest value of every output; one for an output that never changes, or is not known."""
    low, high = (
        edge(values, axis=0, initial=sign * np.inf, where=np.isfinite(values))
        for edge, sign in ((np.min, 1), (np.max, -1))
    )
    ranges = high - low
    return np.where(ranges > 0, ranges, 1.0)
