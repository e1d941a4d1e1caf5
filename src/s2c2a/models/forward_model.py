"""The interface of forward models (C2S), and the constant-curvature model."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.kinematics.bends import bends_from_configurations, configurations_from_bends
from s2c2a.kinematics.chain import States, Vectors, states_from_configurations
from s2c2a.models.arrays import Actions, Configuration, Configurations, Deviations
from s2c2a.models.disturbances import PAYLOAD_ITERATIONS, Disturbances

Stiffnesses = Float[np.ndarray, " modules"]
Memory = Any  # a pytree of arrays; () for a model without memory


class ForwardModel(eqx.Module):
    """Differentiable map from configurations to states (C2S), with optional hysteresis.

    The memory contains the state of the hysteresis only. Payload and bend biases are
    arguments, since a state estimator determines them.
    """

    @property
    def takes_payload(self) -> bool:
        """Whether predictions depend on the payload."""
        return False

    @abstractmethod
    def start(self, sensed: Configuration) -> Memory:
        """Memory of an arm at rest at its first sensed configuration."""

    @abstractmethod
    def observe(self, sensed: Configuration, memory: Memory) -> Memory:
        """Memory after one more sensed configuration."""

    def with_moments(
        self,
        disturbances: Disturbances,
        configurations: Configurations,
        memory: Memory,
        before: Disturbances,
    ) -> Disturbances:
        """Disturbances with the moments of their payload at a configuration.

        Call it once a control step. A model that ignores the payload returns zero
        moments.

        Args:
            disturbances: payload and bend biases.
            configurations: present configurations, module frames.
            memory: of the hysteresis.
            before: disturbances of the last control step, from which to iterate.
        """
        zeros = jnp.zeros_like(disturbances.bend_biases)
        return disturbances._replace(moments=zeros, moments_per_kg=zeros)

    def settled(
        self, disturbances: Disturbances, configurations: Configuration, memory: Memory
    ) -> Disturbances:
        """Disturbances with the moments of their payload on an arm at rest.

        Args:
            disturbances: payload and bend biases.
            configurations: present configurations, module frames.
            memory: of the hysteresis.
        """
        none = Disturbances.none(len(configurations))
        start = disturbances._replace(
            moments=none.moments, moments_per_kg=none.moments_per_kg
        )
        return jax.lax.fori_loop(
            0,
            PAYLOAD_ITERATIONS,
            lambda _, before: self.with_moments(
                disturbances, configurations, memory, before
            ),
            start,
        )

    def with_gains(
        self, disturbances: Disturbances, configurations: Configuration, memory: Memory
    ) -> Disturbances:
        """Disturbances whose moments change with the shape that is predicted.

        A model that ignores the payload returns them unchanged.

        Args:
            disturbances: with moments (`with_moments`).
            configurations: present configurations, module frames.
            memory: of the hysteresis.
        """
        return disturbances

    @abstractmethod
    def predict(
        self,
        configurations: Configurations,
        memory: Memory,
        disturbances: Disturbances | None = None,
    ) -> States:
        """Predicted states [m, 1], base frame.

        Args:
            configurations: planned or sensed, module frames.
            memory: of the hysteresis.
            disturbances: with moments (`with_moments`); None as in the training data.
        """

    def tensions(
        self,
        configurations: Configurations,
        memory: Memory,
        disturbances: Disturbances | None = None,
    ) -> Actions:
        """Predicted cable tensions [N]; NaN if the model does not predict them."""
        return jnp.full((*configurations.shape[:-1], 1), jnp.nan)

    def cable_stiffnesses(self) -> Stiffnesses | None:
        """Cable tension per stretch over the cable radius [N/rad]; None if unknown."""
        return None

    @abstractmethod
    def for_planning(self) -> "ForwardModel":
        """The same predictions with other gradients, for a planner.

        These gradients are useful where the true ones are zero or discontinuous.
        """

    def in_base(self) -> "ForwardModel":
        """The model with its states in the base frame, if they are in another one."""
        return self

    def to_base(self, seen: Vectors) -> Vectors:
        """Positions in the frame of the states, brought to the base frame [m]."""
        return seen

    def near(self, configurations: Configuration, memory: Memory) -> "ForwardModel":
        """A model for plans that start from these configurations.

        Where a control step is shorter than the arm's delay, it
        predicts where the arm arrives.
        """
        return self

    def predictive_std(
        self, configurations: Configurations, memory: Memory
    ) -> Deviations:
        """Standard deviation of the predicted end points [m]; zero if unknown."""
        return jnp.zeros(configurations.shape[:-1])

    def extrapolation(self, configurations: Configurations) -> Float[Array, "*batch"]:
        """The part of it that is due to missing training data nearby [m]."""
        return jnp.zeros(configurations.shape[:-2])


Output = Literal["predict", "predictive_std"]


def along_episode(
    model_at: Callable[[Array], ForwardModel],
    sensed: Float[Array, "samples modules 3"],
    given: Float[Array, "samples ..."],
    output: Output = "predict",
) -> Float[Array, "samples ..."]:
    """An output of a model at every sample of an episode from rest, with its memory.

    Args:
        model_at: the model, from what is given at a sample.
        sensed: configurations.
        given: to `model_at`.
        output: name of the method.
    """

    def step(memory: Memory, now: tuple[Array, Array]) -> tuple[Memory, Array]:
        configurations, moment = now
        model = model_at(moment)
        after = model.observe(configurations, memory)
        return after, getattr(model, output)(configurations, memory)

    start = model_at(given[0]).start(sensed[0])
    return jax.lax.scan(step, start, (sensed, given))[1]


class MemorylessModel(ForwardModel):
    """A forward model without hysteresis, as in the paper."""

    def start(self, sensed: Configuration) -> Memory:
        return ()

    def observe(self, sensed: Configuration, memory: Memory) -> Memory:
        return memory

    def for_planning(self) -> "MemorylessModel":
        """See `ForwardModel`: without memory, the true gradients are used."""
        return self


class WrappedModel(ForwardModel):
    """A model that changes what another one predicts; all else is that of the other."""

    @property
    @abstractmethod
    def inner(self) -> ForwardModel:
        """The other model."""

    def moved(self, configurations: Configurations) -> Configurations:
        """Configurations for the other model; the same by default."""
        return configurations

    @property
    def takes_payload(self) -> bool:
        return self.inner.takes_payload

    def start(self, sensed: Configurations) -> Memory:
        return self.inner.start(self.moved(sensed))

    def observe(self, sensed: Configurations, memory: Memory) -> Memory:
        return self.inner.observe(self.moved(sensed), memory)

    def with_moments(
        self,
        disturbances: Disturbances,
        configurations: Configurations,
        memory: Memory,
        before: Disturbances,
    ) -> Disturbances:
        moved = self.moved(configurations)
        return self.inner.with_moments(disturbances, moved, memory, before)

    def with_gains(
        self, disturbances: Disturbances, configurations: Configuration, memory: Memory
    ) -> Disturbances:
        return self.inner.with_gains(disturbances, self.moved(configurations), memory)

    def tensions(
        self,
        configurations: Configurations,
        memory: Memory,
        disturbances: Disturbances | None = None,
    ) -> Actions:
        return self.inner.tensions(self.moved(configurations), memory, disturbances)

    def cable_stiffnesses(self) -> Stiffnesses | None:
        return self.inner.cable_stiffnesses()

    def predictive_std(
        self, configurations: Configurations, memory: Memory
    ) -> Deviations:
        return self.inner.predictive_std(self.moved(configurations), memory)

    def extrapolation(self, configurations: Configurations) -> Float[Array, "*batch"]:
        return self.inner.extrapolation(self.moved(configurations))


class PCCForwardModel(MemorylessModel):
    """The arm as constant-curvature arcs.

    Attributes:
        lengths: module lengths [m], shape (modules,).
    """

    lengths: Float[Array, " modules"]

    @classmethod
    def of(cls, arm: ArmSpec) -> "PCCForwardModel":
        """The model with the arm's nominal lengths."""
        return cls(jnp.asarray(ArmGeometry.of(arm).lengths, dtype=jnp.float32))

    def predict(
        self,
        configurations: Configurations,
        memory: Memory,
        disturbances: Disturbances | None = None,
    ) -> States:
        """See `ForwardModel`: bend biases are added to the bends."""
        if disturbances is not None:
            bends = bends_from_configurations(configurations)
            configurations = configurations_from_bends(bends + disturbances.bend_biases)
        return states_from_configurations(configurations, self.lengths)
