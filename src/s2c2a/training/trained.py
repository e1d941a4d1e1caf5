"""Training data, and trained models with their errors on test samples."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data import Samples, Split
from s2c2a.training.fit import Batch, FitOptions, Loss, Network, TrainingProgress, fit

Outputs = Float[np.ndarray, "samples modules outputs"]
Ranges = Float[np.ndarray, "modules outputs"]
ModelType = TypeVar("ModelType", bound=eqx.Module, covariant=True)


@dataclass(frozen=True)
class TrainingData:
    """Complete episodes of one arm, each from rest.

    Attributes:
        arm: the arm.
        sensed: sensed configurations.
        actions: actions that were sent [m or N].
        states: true states at the same times [m, 1], base frame; NaN: unknown.
        lengths: number of samples of each episode, if they differ; the rest is padding.
        displacements: displacements of the cables over their radius [rad], if cables
            also move together, which configurations do not contain.
    """

    arm: ArmSpec
    sensed: Float[np.ndarray, "episodes samples modules 3"]
    actions: Float[np.ndarray, "episodes samples modules cables"]
    states: Float[np.ndarray, "episodes samples modules 6"]
    lengths: tuple[int, ...] | None = None
    displacements: Float[np.ndarray, "episodes samples modules cables"] | None = None


NO_EPOCHS = np.zeros((1, 3), np.float32)
"""Curve of what is fitted without epochs."""


@dataclass(frozen=True)
class Trained(Generic[ModelType]):
    """Trained model, its learning curve, and its test error.

    Attributes:
        network: the model.
        curve: rows of epoch, training loss, validation loss.
        percent: mean and standard deviation of the test error, in percent of the full
            range.
        errors: of the tip on held-out samples [m], by the names of
            `evaluation.training_report`; empty if they are unknown.
        spread: of a prior: the model with the standard deviations of its parameters
            over arms; None for a model of one arm.
    """

    network: ModelType
    curve: Float[np.ndarray, "epochs 3"] = field(default_factory=NO_EPOCHS.copy)
    percent: tuple[float, float] = (0.0, 0.0)
    errors: Mapping[str, float] = field(default_factory=dict)
    spread: Any = None


def train(
    model: Network,
    loss: Loss[Network],
    predict: Callable[[Network, Batch], Array],
    split: Split,
    options: FitOptions,
    key: PRNGKeyArray,
    progress: TrainingProgress,
) -> Trained[Network]:
    """Train a model and evaluate it on the test samples.

    Args:
        model: initial model.
        loss: (model, batch, key) -> mean loss of the batch; the key is None in
            validation.
        predict: (model, batch) -> predictions for the targets of the batch.
        split: training, validation, and test samples.
        options: options of the training.
        key: random key for the order of samples and for the loss.
        progress: callback with the epoch, the largest number of epochs, and the
            validation loss.

    Raises:
        TrainingError: there are too few samples, or the loss is not finite.
    """
    fitted, curve = fit(
        model,
        loss,
        as_batch(split.training),
        as_batch(split.validation),
        options,
        key,
        progress,
    )
    return evaluated(fitted, curve, predict, split)


def evaluated(
    network: Network,
    curve: Float[np.ndarray, "epochs 3"],
    predict: Callable[[Network, Batch], Array],
    split: Split,
) -> Trained[Network]:
    """Fitted model with its error on the test samples."""
    predicted = np.asarray(eqx.filter_jit(predict)(network, as_batch(split.test)))
    ranges = full_ranges(np.concatenate([part.targets for part in split.parts]))
    percent = percent_error(predicted, split.test.targets, ranges)
    return Trained(network, curve, percent)


def known_error(predicted: Array, targets: Array) -> Array:
    """Error of a prediction; zero where the target is unknown (NaN)."""
    known = jnp.isfinite(targets)
    return jnp.where(known, predicted - jnp.where(known, targets, 0.0), 0.0)


def as_batch(samples: Samples) -> Batch:
    """Inputs and targets in one dictionary, for the training loop."""
    batch = {name: jnp.asarray(values) for name, values in samples.inputs.items()}
    batch["targets"] = jnp.asarray(samples.targets)
    return batch


def percent_error(
    predicted: Outputs, true: Outputs, ranges: Ranges
) -> tuple[float, float]:
    """Mean and standard deviation of |error|, in percent of each output's full range.

    Unknown outputs (NaN) do not count.
    """
    percent = (100.0 * np.abs(predicted - true) / ranges)[np.isfinite(true)]
    return float(percent.mean()), float(percent.std())


def full_ranges(values: Outputs) -> Ranges:
    """Range of each output; one for an output that is constant or unknown.

    What moves by less than the resolution of single precision is constant, as across the
    plane of a planar arm.
    """
    known = np.isfinite(values)
    low = np.min(values, axis=0, initial=np.inf, where=known)
    high = np.max(values, axis=0, initial=-np.inf, where=known)
    ranges = high - low
    resolution = np.finfo(np.float32).eps * np.max(np.abs(values[known]), initial=0.0)
    return np.where(ranges > resolution, ranges, 1.0)
