"""What a forward model is made of, as recipes say it, and the paper's: C2S, a biLSTM from configurations to states."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray
from pydantic import ConfigDict

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions, forward_samples
from s2c2a.errors import TrainingError
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import ForwardModel, Memory, MemorylessModel
from s2c2a.models.layers import BiLSTM, Scaling, Size
from s2c2a.training.fit import Batch, FitOptions, Progress, quiet
from s2c2a.training.trained import Trained, TrainingData, known_error, train


@dataclass(frozen=True)
class ForwardOptions(ABC):
    """The numbers of a forward model, and how a model comes of them.

    A frozen dataclass below this one is all that a model of one's own needs. A recipe
    file names it, and gives its numbers: `[c2s]`, `model = "my_model.py:MyOptions"`,
    and a line for each (docs/extending.md).

    Attributes:
        model: the name by which recipes find this class.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    model: str = field(default="", kw_only=True)

    @abstractmethod
    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> ForwardModel:
        """The model before training.

        Files are read into it: options and arm alone decide how many arrays it has, and
        their shapes.
        """

    def answers(
        self, model: ForwardModel, data: TrainingData
    ) -> Float[np.ndarray, "episodes samples modules 6"]:
        """States that a model of these options says along whole episodes, from what was sensed [m, 1], base frame."""

        @eqx.filter_jit
        def along(
            model: ForwardModel, sensed: Float[Array, "samples modules 3"]
        ) -> Array:
            def step(memory, now):
                return model.observe(now, memory), model.predict(now, memory)

            return jax.lax.scan(step, model.start(sensed[0]), sensed)[1]

        return np.stack(
            [along(model, jnp.asarray(sensed, jnp.float32)) for sensed in data.sensed]
        )

    @abstractmethod
    def train(
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained[ForwardModel]:
        """The model trained.

        Args:
            data: to learn from.
            fit: how to train.
            key: of everything random.
            progress: called with epoch, number of epochs, validation loss.

        Raises:
            TrainingError: too few samples, or the loss is not finite.
        """

    def carried(
        self,
        model: ForwardModel,
        old: ArmSpec,
        new: ArmSpec,
        babbling: CollectOptions,
        key: PRNGKeyArray,
    ) -> ForwardModel:
        """What another arm of the same make begins with.

        Args:
            model: trained.
            old: for which arm.
            new: the arm that begins.
            babbling: how its data would be collected.
            key: of everything random.

        Raises:
            TrainingError: such models begin from nothing.
        """
        raise TrainingError(
            f"forward models '{self.model}' begin from nothing; train without --from"
        )

    def go_on(
        self,
        model: ForwardModel,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained[ForwardModel]:
        """A model that began elsewhere, trained; see `train`."""
        raise TrainingError(
            f"forward models '{self.model}' begin from nothing; train without --from"
        )


class C2S(MemorylessModel):
    """NN_C2S of the paper (Chen et al. 2025, fig. 5A), with its scaling.

    Example:
        >>> model = C2SOptions(layers=4, hidden=64).untrained(load_arm("twin_arm"), jax.random.key(0))
        >>> model.predict(jnp.zeros((3, 3)), memory=()).shape
        (3, 6)
    """

    network: BiLSTM
    configuration_scaling: Scaling
    state_scaling: Scaling

    def predict(
        self,
        configurations: Float[Array, "*batch modules 3"],
        memory: Memory,
        disturbances: Disturbances | None = None,
    ) -> Float[Array, "*batch modules 6"]:
        """See `ForwardModel`: disturbances are ignored."""
        return self.state_scaling.back(
            self.network(self.configuration_scaling.forward(configurations))
        )


@dataclass(frozen=True)
class C2SOptions(Size, ForwardOptions):
    """The biLSTM of the paper's C2S."""

    model: str = field(default="bilstm", kw_only=True)

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
        progress: Progress = quiet,
    ) -> Trained[C2S]:
        """See `ForwardOptions`; each sample by itself."""
        network_key, fit_key = jax.random.split(key)
        split = forward_samples(data.sensed, data.states, data.lengths)
        model = replace(
            self.untrained(data.arm, network_key),
            configuration_scaling=Scaling.of(split.training.inputs["configurations"]),
            state_scaling=state_scaling(split.training.targets),
        )
        return train(model, _loss, _answer, split, fit, fit_key, progress)


def _answer(model: C2S, batch: Batch) -> Array:
    return model.predict(batch["configurations"], ())


def _loss(model: C2S, batch: Batch, key: PRNGKeyArray | None) -> Array:
    return jnp.mean(
        (
            known_error(_answer(model, batch), batch["targets"])
            / model.state_scaling.half_range
        )
        ** 2
    )


def state_scaling(states: Float[np.ndarray, "*batch modules 6"]) -> Scaling:
    """Positions about their center by half their widest extent, axes as they are.

    x, y and z have one scale [m], so that spheres stay spheres.
    """
    positions = states[..., :3].reshape(-1, 3)
    low = np.nanmin(positions, axis=0)
    high = np.nanmax(positions, axis=0)
    center = (low + high) / 2
    half = [float((high - low).max() / 2)] * 3 + [1.0] * 3
    return Scaling(
        jnp.array([*center, 0.0, 0.0, 0.0], dtype=jnp.float32),
        jnp.array(half, dtype=jnp.float32),
    )
