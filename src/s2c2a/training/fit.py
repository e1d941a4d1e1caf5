"""The training loop: whole epochs inside one compiled call, stopped when validation no longer improves.

What of a model is learned and what is fixed is said by type, here and in files.
"""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, Self, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError, TrainingError

MOST = 1_000_000  # epochs, and samples in a batch
Batch = dict[str, Array]
Network = TypeVar("Network", bound=eqx.Module)
Model = TypeVar("Model", bound=eqx.Module, covariant=True)
Loss = Callable[[Network, Batch, PRNGKeyArray | None], Float[Array, ""]]
Progress = Callable[[int, int, float], None]
"""Told the epoch, the most epochs and the validation loss."""


def quiet(epoch: int, most: int, loss: float) -> None:
    """A progress that tells nobody."""


@dataclass(frozen=True)
class FitOptions:
    """How to train (Chen et al. 2025, table II).

    Attributes:
        learning_rate: of Adam.
        batch_size: samples in a step.
        max_epochs: stop here at the latest.
        patience: stop after so many epochs without a better validation loss; looked at
            between calls.
        epochs_per_call: epochs inside one compiled call; progress and interrupts come
            between calls.
        decay: whether the learning rate falls to zero over the most epochs, along half
            a cosine.
    """

    learning_rate: float = 1e-3
    batch_size: int = 64
    max_epochs: int = 100
    patience: int = 15
    epochs_per_call: int = 5
    decay: bool = False

    def __post_init__(self):
        """Refuse what cannot be trained with."""
        counts = {
            name: (1, MOST)
            for name in ("batch_size", "max_epochs", "patience", "epochs_per_call")
        }
        check_limits(self, learning_rate=(0, 10), **counts)


@dataclass(frozen=True)
class FitResult(Generic[Model]):
    """A trained network and how it got there.

    Attributes:
        network: with the weights of the best validation loss.
        curve: rows of epoch, training loss, validation loss, shape (epochs, 3).
    """

    network: Model
    curve: Float[np.ndarray, "epochs 3"]


class _Progress(NamedTuple):
    """What training carries from epoch to epoch."""

    weights: Array
    optimizer: Array
    best_weights: Array
    best_loss: Float[Array, ""]


def fit(
    network: Network,
    loss: Loss[Network],
    training: Batch,
    validation: Batch,
    options: FitOptions,
    key: PRNGKeyArray,
    progress: Progress = quiet,
) -> FitResult[Network]:
    """Train a network with Adam.

    Args:
        network: what to train; every floating array in it is a weight, but for those of
            parts that are `Fixed`.
        loss: (network, batch, key) -> mean loss of the batch; the key is None when
            validating.
        training: arrays with samples first.
        validation: arrays with samples first.
        options: how to train.
        key: for the order of samples and for the loss.
        progress: told the epoch, the most epochs and the validation loss, after every
            call.

    Raises:
        TrainingError: fewer samples than one batch, or the loss is not finite.
    """
    samples = len(next(iter(training.values())))
    if samples < options.batch_size:
        raise TrainingError(
            f"{samples} training samples, fewer than one batch of {options.batch_size}; collect more"
        )
    weights, rest = eqx.partition(network, eqx.is_inexact_array)
    optimizer = optax.adam(_learning_rate(options, samples))
    run = _compiled_epochs(
        lambda w, batch, k: loss(held(eqx.combine(w, rest)), batch, k),
        optimizer,
        samples,
        options,
    )
    state = _Progress(weights, optimizer.init(weights), weights, jnp.array(jnp.inf))
    curve: list[np.ndarray] = []
    while not _stopped(curve, options):
        key, call_key = jax.random.split(key)
        epochs = min(options.epochs_per_call, options.max_epochs - len(curve))
        state, rows = run(
            state, training, validation, jax.random.split(call_key, epochs)
        )
        curve.extend(np.asarray(rows))
        if not np.isfinite(curve[-1]).all():
            done = f"{len(curve)} epochs"
            raise TrainingError(
                f"the loss is not finite after {done}; lower the learning rate, check the data"
            )
        progress(len(curve), options.max_epochs, float(state.best_loss))
    numbered = np.column_stack([np.arange(1, len(curve) + 1), np.array(curve)])
    return FitResult(eqx.combine(state.best_weights, rest), numbered)


def _learning_rate(options: FitOptions, samples: int) -> float | optax.Schedule:
    if not options.decay:
        return options.learning_rate
    return optax.cosine_decay_schedule(
        options.learning_rate, options.max_epochs * (samples // options.batch_size)
    )


def _compiled_epochs(loss, optimizer, samples: int, options: FitOptions):
    """(state, training, validation, keys) -> (state, losses), an epoch for every key, in one call."""

    def step(carry, picked):
        (weights, state) = carry
        (batch, key) = picked
        value, gradient = jax.value_and_grad(loss)(weights, batch, key)
        updates, state = optimizer.update(gradient, state)
        return (optax.apply_updates(weights, updates), state), value

    def epoch(carry, key, training, validation):
        order_key, loss_key = jax.random.split(key)
        batches = samples // options.batch_size
        order = jax.random.permutation(order_key, samples)[
            : batches * options.batch_size
        ].reshape(batches, -1)
        shuffled = jax.tree.map(lambda values: values[order], training)
        steps = (shuffled, jax.random.split(loss_key, batches))
        (weights, state), losses = jax.lax.scan(
            step, (carry.weights, carry.optimizer), steps
        )
        held_out = loss(weights, validation, None)
        better = held_out < carry.best_loss
        best = jax.tree.map(
            lambda new, old: jnp.where(better, new, old), weights, carry.best_weights
        )
        progress = _Progress(
            weights, state, best, jnp.minimum(held_out, carry.best_loss)
        )
        return progress, jnp.stack([losses.mean(), held_out])

    def epochs(carry, training, validation, keys):
        return jax.lax.scan(lambda c, k: epoch(c, k, training, validation), carry, keys)

    return jax.jit(epochs)


def _stopped(curve: list[np.ndarray], options: FitOptions) -> bool:
    if not curve:
        return False
    since_best = len(curve) - 1 - int(np.argmin([row[1] for row in curve]))
    return since_best >= options.patience or len(curve) >= options.max_epochs


class Fixed(eqx.Module):
    """A part of a model that training does not move, such as a scaling; files keep it."""


class FromArm(Fixed):
    """A part that follows from the arm alone: no file keeps it, so that none can say of an arm what it is not."""

    @classmethod
    @abstractmethod
    def of(cls, arm: ArmSpec) -> Self:
        """The part for an arm."""


def held(model: Network) -> Network:
    """The same model, without gradients of what is fixed."""
    return jax.tree.map(
        lambda part: jax.lax.stop_gradient(part) if _is_fixed(part) else part,
        model,
        is_leaf=_is_fixed,
    )


def _is_fixed(part) -> bool:
    return isinstance(part, Fixed)


MAX_VALUES = 100
"""Of one option that has several."""


def check_limits(
    options: Any, error: type[S2C2AError] = TrainingError, **limits: tuple[float, float]
) -> None:
    """Refuse options of which a number is out of its limits, or no number.

    Args:
        options: with an attribute for every limit: a number or a tuple of them.
        error: what to raise.
        limits: least and largest value of each.

    Raises:
        S2C2AError: of the kind that is asked for.
    """
    for name, (low, high) in limits.items():
        value = getattr(options, name)
        values = value if isinstance(value, tuple) else (value,)
        if len(values) > MAX_VALUES:
            raise error(
                f"{len(values)} values of {name} were asked for; take {MAX_VALUES} at most"
            )
        if not all(low <= one <= high for one in values):  # NaN is neither
            raise error(f"{name} = {value} was asked for; take {low:g} to {high:g}")
