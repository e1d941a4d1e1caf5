"""Training of the paper's networks in PyTorch, with the settings of the JAX training.

Needs PyTorch; the extra `bench` brings it.
"""

import time
from collections.abc import Callable
from copy import deepcopy

import jax
import numpy as np
import torch
from torch import Tensor, nn

from s2c2a.arm import ArmGeometry
from s2c2a.data import Recording, Samples, controller_samples, forward_samples
from s2c2a.errors import StrategyError
from s2c2a.models import C2A, C2S, C2SOptions, History
from s2c2a.models.layers import Scaling, SumAndRange
from s2c2a.strategies import Recipe
from s2c2a.training import FitOptions
from torch_networks import TorchC2A, TorchC2S, tensor

Batch = dict[str, Tensor]
Loss = Callable[[Batch, bool], Tensor]
"""Of a batch, and whether it is for learning: past actions then carry noise."""

TRIED = 20  # batches, to see how many threads serve best
COMPARED = 64  # samples


class TorchTraining:
    """A network in training: shuffled batches, validation loss, best weights kept."""

    def __init__(
        self,
        model: nn.Module,
        loss: Loss,
        training: Batch,
        validation: Batch,
        options: FitOptions,
    ):
        self.model = model
        self._loss = loss
        self._size = options.batch_size
        self._training = training
        self._validation = validation
        self._optimizer = torch.optim.Adam(model.parameters(), lr=options.learning_rate)
        self.best_loss = float("inf")

    def epoch(self) -> float:
        """Train for an epoch; how long it took [s]."""
        began = time.perf_counter()
        self._steps(self._batches())
        with torch.no_grad():
            held_out = float(self._loss(self._validation, False))
        # as stopping early needs it, in the time of an epoch
        if held_out < self.best_loss:
            self.best_weights = deepcopy(self.model.state_dict())
            self.best_loss = held_out
        return time.perf_counter() - began

    def take_best_threads(self, most: int) -> int:
        """Train a few batches with one and with all threads, and keep the faster."""
        took = {}
        for threads in (1, most):
            torch.set_num_threads(threads)
            self._steps(self._batches()[:TRIED])
            began = time.perf_counter()
            self._steps(self._batches()[:TRIED])
            took[threads] = time.perf_counter() - began
        best = min(took, key=lambda threads: took[threads])
        torch.set_num_threads(best)
        return best

    def _batches(self) -> Tensor:
        samples = len(self._training["targets"])
        return torch.randperm(samples)[: samples // self._size * self._size].reshape(
            -1, self._size
        )

    def _steps(self, batches: Tensor) -> None:
        for picked in batches:
            self._optimizer.zero_grad()
            self._loss(
                {name: values[picked] for name, values in self._training.items()}, True
            ).backward()
            self._optimizer.step()


def trainings(
    recording: Recording, recipe: Recipe, seed: int
) -> dict[str, TorchTraining]:
    """Both networks of the paper's recipe before training, by their names."""
    torch.manual_seed(seed)
    sensed = recipe.estimator(recording.arm).sensed(recording.readings())
    c2s_key, c2a_key = jax.random.split(jax.random.key(seed))
    return {
        "C2S": c2s_training(sensed, recording, recipe, c2s_key),
        "C2A": c2a_training(sensed, recording, recipe, c2a_key),
    }


def c2s_training(
    sensed: np.ndarray, recording: Recording, recipe: Recipe, key
) -> TorchTraining:
    """NN_C2S on sensed configurations and true states.

    Raises:
        StrategyError: the recipe's forward model is not the paper's.
    """
    if not isinstance(recipe.c2s, C2SOptions):
        raise StrategyError(
            f"the forward model of the recipe '{recipe.name}' is no biLSTM; "
            "choose the recipe 'paper'"
        )
    split = forward_samples(sensed, recording.sensor("states"))
    blank = recipe.c2s.untrained(recording.arm, key)
    scalings = (
        Scaling.of(split.training.inputs["configurations"]),
        Scaling.of_states(split.training.targets),
    )
    model = TorchC2S(C2S(blank.network, *scalings))

    def loss(batch: Batch, learning: bool) -> Tensor:
        error = model(batch["configurations"]) - batch["targets"]
        return torch.mean((error / model.state_scaling.half_range) ** 2)

    return TorchTraining(
        model, loss, _batch(split.training), _batch(split.validation), recipe.c2s_fit
    )


def c2a_training(
    sensed: np.ndarray, recording: Recording, recipe: Recipe, key
) -> TorchTraining:
    """NN_C2A on what led from one sensed configuration to the next."""
    arm = recording.arm
    split = controller_samples(
        sensed, recording.actions, ArmGeometry.of(arm).action_neutral
    )
    blank = recipe.c2a.untrained(arm, key)
    ours = C2A(
        blank.network, Scaling.of(split.training.inputs["desired"]), blank.sum_and_range
    )
    model = TorchC2A(ours)

    def loss(batch: Batch, learning: bool) -> Tensor:
        actions = batch["actions"]
        if learning:
            actions = actions + recipe.history_noise * torch.randn_like(actions)
        return torch.mean(
            (
                model(batch["desired"], batch["configurations"], actions)
                - batch["targets"]
            )
            ** 2
        )

    seen, held_out = (
        _batch(_normalized(part, blank.sum_and_range))
        for part in (split.training, split.validation)
    )
    _check_same(ours, model, {name: values[:COMPARED] for name, values in seen.items()})
    return TorchTraining(model, loss, seen, held_out, recipe.c2a_fit)


def _check_same(ours: C2A, theirs: TorchC2A, batch: Batch) -> None:
    """Both networks predict the same, so their times are comparable."""
    desired, configurations, actions = (
        batch[name] for name in ("desired", "configurations", "actions")
    )
    with torch.no_grad():
        predicted = theirs(desired, configurations, actions).numpy()
    history = History(configurations.numpy(), actions.numpy())
    np.testing.assert_allclose(predicted, ours(desired.numpy(), history), atol=1e-5)


def _normalized(samples: Samples, layer: SumAndRange) -> Samples:
    """Normalized actions; past ones have an axis of ages before their cables."""
    neutral = np.asarray(layer.neutral)
    unit = np.asarray(layer.unit)
    past = (samples.inputs["actions"] - neutral[:, None]) / unit[:, None]
    return Samples(
        samples.inputs | {"actions": past}, (samples.targets - neutral) / unit
    )


def _batch(samples: Samples) -> Batch:
    return {
        name: tensor(values)
        for name, values in (samples.inputs | {"targets": samples.targets}).items()
    }
