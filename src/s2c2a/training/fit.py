"""Training loop: compiled epochs, with early stopping on the validation loss.

The type of a part determines whether it is trained and whether files keep it.
"""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Self, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.errors import TrainingError, counted
from s2c2a.execution.compilation import compiled, select
from s2c2a.files.text import MAX_COUNT, MAX_SEED, is_seed
from s2c2a.kinematics.bends import Scalar
from s2c2a.paper import BATCH_SIZE, EPOCHS, LEARNING_RATE
from s2c2a.plugins.components import Options, Ranges

Batch = dict[str, Array]
Network = TypeVar("Network", bound=eqx.Module)
Loss = Callable[[Network, Batch, PRNGKeyArray | None], Scalar]
TrainingProgress = Callable[[int, int, float], None]
"""Callback with the epoch, the largest number of epochs, and the validation loss."""


def random_key(seed: int) -> PRNGKeyArray:
    """Key of everything random in a training.

    Raises:
        TrainingError: the seed is out of range.
    """
    if not is_seed(seed):
        raise TrainingError(f"seed {seed} was given; give one from 0 to {MAX_SEED}")
    return jax.random.key(seed)


def quiet(epoch: int, max_epochs: int, loss: float) -> None:
    """Progress callback that does nothing."""


@dataclass(frozen=True)
class FitOptions(Options):
    """Options of the training (Chen et al. 2025, table II).

    Attributes:
        learning_rate: learning rate of Adam.
        batch_size: number of samples in a batch.
        max_epochs: largest number of epochs.
        patience: number of epochs without a better validation loss after which training
            stops, checked between calls.
        epochs_per_call: number of epochs in one compiled call; progress and interrupts
            happen between calls.
        decay: whether the learning rate decays to zero over `max_epochs`, along half a
            cosine.
    """

    learning_rate: float = LEARNING_RATE
    batch_size: int = BATCH_SIZE
    max_epochs: int = EPOCHS
    patience: int = 15
    epochs_per_call: int = 5
    decay: bool = False

    limits: ClassVar[Ranges] = {
        "learning_rate": (0, 10),
        "batch_size": (1, MAX_COUNT),
        "max_epochs": (1, MAX_COUNT),
        "patience": (1, MAX_COUNT),
        "epochs_per_call": (1, MAX_COUNT),
    }


class _State(NamedTuple):
    """State of the training between epochs.

    Attributes:
        weights: after the last epoch.
        optimizer: its state.
        best_weights: those of the best validation loss.
        best_loss: that loss.
        decay_steps: number of steps until the learning rate is zero.
    """

    weights: Array
    optimizer: Array
    best_weights: Array
    best_loss: Scalar
    decay_steps: Scalar


def fit(
    network: Network,
    loss: Loss[Network],
    training: Batch,
    validation: Batch,
    options: FitOptions,
    key: PRNGKeyArray,
    progress: TrainingProgress = quiet,
) -> tuple[Network, Float[np.ndarray, "epochs 3"]]:
    """Train a network with Adam.

    Args:
        network: network to train; all floating-point arrays are weights, except those
            of `Fixed` parts.
        loss: (network, batch, key) -> mean loss of the batch; the key is None in
            validation. A module-level function, or a module whose arrays are inputs:
            then equal trainings share a compiled program.
        training: arrays with samples as the first axis.
        validation: arrays with samples as the first axis.
        options: options of the training.
        key: random key for the order of samples and for the loss.
        progress: callback with the epoch, the largest number of epochs, and the
            validation loss, before the first compiled call and after each.

    Returns:
        The network with the weights of the best validation loss, and the learning
        curve: rows of epoch, training loss, validation loss.

    Raises:
        TrainingError: there are fewer samples than one batch, or the loss is not
            finite.
    """
    samples = len(next(iter(training.values())))
    if samples < options.batch_size:
        raise TrainingError(
            f"{counted(samples, 'training sample')}, fewer than one batch of "
            f"{options.batch_size}; collect more"
        )
    weights, rest = eqx.partition(network, eqx.is_inexact_array)
    # an input of the program, so that trainings of any length share it
    decay_steps = jnp.asarray(
        float(options.max_epochs * (samples // options.batch_size))
    )
    optimizer = _optimizer(options, decay_steps)
    # what the program of an epoch depends on: the other options are defaults
    lengths = ("max_epochs", "patience", "epochs_per_call")
    defaults = {name: getattr(FitOptions, name) for name in lengths}
    run = compiled(_train_epochs, loss, rest, replace(options, **defaults))
    state = _State(
        weights, optimizer.init(weights), weights, jnp.array(jnp.inf), decay_steps
    )
    curve: list[np.ndarray] = []
    progress(0, options.max_epochs, float(state.best_loss))
    since_best = 0
    while since_best < options.patience and len(curve) < options.max_epochs:
        key, call_key = jax.random.split(key)
        epochs = min(options.epochs_per_call, options.max_epochs - len(curve))
        state, rows = run(
            state, training, validation, jax.random.split(call_key, epochs)
        )
        curve.extend(np.asarray(rows))
        if not np.isfinite(curve[-1]).all():
            raise TrainingError(
                f"the loss is not finite after {counted(len(curve), 'epoch')}; "
                "lower the learning rate or check the data"
            )
        since_best = len(curve) - 1 - int(np.argmin([row[1] for row in curve]))
        progress(len(curve), options.max_epochs, float(state.best_loss))
    numbered = np.column_stack([np.arange(1, len(curve) + 1), np.array(curve)])
    return eqx.combine(state.best_weights, rest), numbered


def _optimizer(
    options: FitOptions, decay_steps: Scalar
) -> optax.GradientTransformation:
    if not options.decay:
        return optax.adam(options.learning_rate)

    def rate(step: Array) -> Array:
        progress = jnp.minimum(step / decay_steps, 1.0)
        return options.learning_rate * (1.0 + jnp.cos(jnp.pi * progress)) / 2.0

    return optax.adam(rate)


def _train_epochs(
    loss: Loss,
    rest: eqx.Module,
    options: FitOptions,
    state: _State,
    training: Batch,
    validation: Batch,
    keys: PRNGKeyArray,
) -> tuple[_State, Float[Array, "epochs 2"]]:
    """Train for one epoch per key.

    Args:
        loss: as in `fit`.
        rest: the network without its weights.
        options: options of the training.
        state: before the epochs.
        training: arrays with samples as the first axis.
        validation: arrays with samples as the first axis.
        keys: random keys, shape (epochs,).

    Returns:
        State after the epochs; training and validation loss of each epoch.
    """
    samples = len(next(iter(training.values())))
    batches = samples // options.batch_size
    optimizer = _optimizer(options, state.decay_steps)

    def weights_loss(weights, batch, key):
        return loss(held(eqx.combine(weights, rest)), batch, key)

    def step(carry, inputs):
        weights, state = carry
        batch, key = inputs
        value, gradient = jax.value_and_grad(weights_loss)(weights, batch, key)
        updates, state = optimizer.update(gradient, state)
        return (optax.apply_updates(weights, updates), state), value

    def epoch(carry, key):
        order_key, loss_key = jax.random.split(key)
        order = jax.random.permutation(order_key, samples)
        order = order[: batches * options.batch_size].reshape(batches, -1)
        shuffled = jax.tree.map(lambda values: values[order], training)
        steps = (shuffled, jax.random.split(loss_key, batches))
        (weights, optimizer_state), losses = jax.lax.scan(
            step, (carry.weights, carry.optimizer), steps
        )
        validation_loss = weights_loss(weights, validation, None)
        better = validation_loss < carry.best_loss
        best = select(better, weights, carry.best_weights)
        best_loss = jnp.minimum(validation_loss, carry.best_loss)
        updated = carry._replace(
            weights=weights,
            optimizer=optimizer_state,
            best_weights=best,
            best_loss=best_loss,
        )
        return updated, jnp.stack([losses.mean(), validation_loss])

    return jax.lax.scan(epoch, state, keys)


class Fixed(eqx.Module):
    """Part of a model that is not trained, such as a scaling; files keep it."""


class FromArm(Fixed):
    """Fixed part that follows from the arm alone, so that files do not keep it."""

    @classmethod
    @abstractmethod
    def of(cls, arm: ArmSpec) -> Self:
        """Part for an arm."""


def held(model: Network) -> Network:
    """Model without gradients of its fixed parts."""
    return jax.tree.map(
        lambda part: jax.lax.stop_gradient(part) if is_fixed(part) else part,
        model,
        is_leaf=is_fixed,
    )


def is_fixed(part: Any) -> bool:
    """Whether a part of a model is not trained."""
    return isinstance(part, Fixed)


def parameters(model: eqx.Module) -> list[Array]:
    """All trained arrays of a model."""
    parts = jax.tree.leaves(model, is_leaf=is_fixed)
    return [part for part in parts if eqx.is_inexact_array(part)]
