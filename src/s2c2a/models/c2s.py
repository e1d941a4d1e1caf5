"""Options of forward models, and the paper's C2S: configurations to states."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data.windows import EpisodeStates, forward_samples
from s2c2a.errors import TrainingError
from s2c2a.models.arrays import Configurations
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import (
    ForwardModel,
    Memory,
    MemorylessModel,
    Output,
    along_episode,
)
from s2c2a.models.layers import Scaling, Size
from s2c2a.paper import BiLSTM
from s2c2a.plugins.components import Options
from s2c2a.training.fit import Batch, FitOptions, TrainingProgress, quiet
from s2c2a.training.trained import Trained, TrainingData, known_error, train


@dataclass(frozen=True)
class ForwardOptions(Options, ABC):
    """Options of a forward model; they build and train it.

    A custom model needs one frozen dataclass that derives from this class. A recipe
    file names it and sets its fields: `[c2s]`, `model = "my_model.py:MyOptions"`, and
    one line for each field (docs/guides/extending.md).

    Attributes:
        model: name of this class in recipes.
    """

    model: str = field(default="", kw_only=True)

    @abstractmethod
    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> ForwardModel:
        """The model before training.

        Weights are loaded from files into it: options and arm alone determine the
        number of arrays and their shapes.
        """

    def predictions(self, model: ForwardModel, data: TrainingData) -> EpisodeStates:
        """Predict the states of whole episodes [m, 1], base frame."""
        return _along_episodes(model, data, "predict")

    def deviations(
        self, model: ForwardModel, data: TrainingData
    ) -> Float[np.ndarray, "episodes samples modules"]:
        """Standard deviations of the end points of whole episodes [m]; zero: unknown.

        Each is the root of the expected squared distance (`predictive_std`).
        """
        return _along_episodes(model, data, "predictive_std")

    @abstractmethod
    def train(
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[ForwardModel]:
        """Train the model.

        Args:
            data: recorded episodes.
            fit: options of the training.
            key: of all random numbers.
            progress: called with epoch, maximum number of epochs and validation loss.

        Raises:
            TrainingError: there are too few samples, or the loss is not finite.
        """

    def resume_training(
        self,
        model: ForwardModel,
        spread: eqx.Module,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[ForwardModel]:
        """Train a prior (`pretrain`) on few samples of one arm; see `train`.

        Args:
            model: mean over arms.
            spread: of its parameters over arms.
            data: recorded episodes of the arm.
            fit: options of the training.
            key: of all random numbers.
            progress: see `train`.
        """
        raise TrainingError(
            f"forward models '{self.model}' begin from nothing; train without --from"
        )

    def pretrain(
        self,
        arms: Sequence[TrainingData],
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[ForwardModel]:
        """Learn a prior over arms from recordings of several ones.

        Args:
            arms: recorded episodes of each arm; episodes have the same shape.
            fit: options of the training.
            key: of all random numbers.
            progress: see `train`.

        Raises:
            TrainingError: this kind of model has no prior, or training failed.
        """
        raise TrainingError(
            f"forward models '{self.model}' have no prior; choose a recipe with "
            "model = 'chain' or 'local', such as best"
        )


def _along_episodes(
    model: ForwardModel, data: TrainingData, output: Output
) -> np.ndarray:
    """An output of the model at every sample of all episodes."""
    run = eqx.filter_jit(
        lambda model, sensed: along_episode(lambda _: model, sensed, sensed, output)
    )
    episodes = jnp.asarray(data.sensed, jnp.float32)
    return np.stack([run(model, sensed) for sensed in episodes])


class C2S(MemorylessModel):
    """NN_C2S of the paper (Chen et al. 2025, fig. 5A), with its scaling.

    Example:
        >>> options = C2SOptions(layers=4, hidden=64)
        >>> model = options.untrained(load_arm("twin_arm"), jax.random.key(0))
        >>> model.predict(jnp.zeros((3, 3)), memory=()).shape
        (3, 6)
    """

    network: BiLSTM
    configuration_scaling: Scaling
    state_scaling: Scaling

    def predict(
        self,
        configurations: Configurations,
        memory: Memory,
        disturbances: Disturbances | None = None,
    ) -> Float[Array, "*batch modules 6"]:
        """See `ForwardModel`: disturbances are ignored."""
        outputs = self.network(self.configuration_scaling.forward(configurations))
        return self.state_scaling.back(outputs)


@dataclass(frozen=True)
class C2SOptions(Size, ForwardOptions):
    """The biLSTM of the paper's C2S."""

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> C2S:
        """Random weights and no scaling."""
        return C2S(
            BiLSTM(3, 6, self.layers, self.hidden, key),
            Scaling.identity(3),
            Scaling.identity(6),
        )

    def train(
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[C2S]:
        """See `ForwardOptions`; on single samples."""
        network_key, fit_key = jax.random.split(key)
        split = forward_samples(data.sensed, data.states, data.lengths)
        model = replace(
            self.untrained(data.arm, network_key),
            configuration_scaling=Scaling.of(split.training.inputs["configurations"]),
            state_scaling=Scaling.of_states(split.training.targets),
        )
        return train(model, _loss, _predict, split, fit, fit_key, progress)


def _predict(model: C2S, batch: Batch) -> Array:
    return model.predict(batch["configurations"], ())


def _loss(model: C2S, batch: Batch, key: PRNGKeyArray | None) -> Array:
    error = known_error(_predict(model, batch), batch["targets"])
    return jnp.mean((error / model.state_scaling.half_range) ** 2)
