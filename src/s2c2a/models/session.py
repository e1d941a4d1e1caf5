"""A forward model on another day: the same arm, placed, homed or tensioned otherwise.

A change of day acts on a few physical quantities: the frame of the tracking; the offsets
of the sensed bends and the slack of the cables (homing, pretension); and the gains of
the bends (stiffness). `SessionC2S` wraps the model of the training with them.
"""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.kinematics.bends import (
    bends_from_configurations,
    configurations_from_bends,
    sinc,
    squared_norm,
)
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import ForwardModel, Memory
from s2c2a.models.trunk import slackened
from s2c2a.spaces import AXIS, POSITION


class DayChange(eqx.Module):
    """What differs from the day of the training; zeros change nothing.

    Attributes:
        translation: of the tracking's frame [m], shape (3,).
        rotation: of the tracking's frame, a rotation vector [rad], shape (3,).
        offsets: added to the sensed bends [rad], shape (modules, 2).
        slack: length by which all cables of a module are longer, over their radius
            [rad], shape (modules,); only models of cables use it.
        gains: relative change of the bends, shape (modules,).
    """

    translation: Float[Array, "3"]
    rotation: Float[Array, "3"]
    offsets: Float[Array, "modules 2"]
    slack: Float[Array, " modules"]
    gains: Float[Array, " modules"]

    @classmethod
    def none(cls, modules: int) -> "DayChange":
        """No change of an arm with so many modules."""
        nothing = jnp.zeros(modules)
        offsets = jnp.zeros((modules, 2))
        return cls(jnp.zeros(3), jnp.zeros(3), offsets, nothing, nothing)

    def moved(
        self, configurations: Float[Array, "*batch modules 3"]
    ) -> Float[Array, "*batch modules 3"]:
        """Configurations that the arm had on the day of the training."""
        bends = bends_from_configurations(configurations) + self.offsets
        return configurations_from_bends(bends * (1.0 + self.gains[:, None]))

    def seen(
        self, states: Float[Array, "*batch modules 6"]
    ) -> Float[Array, "*batch modules 6"]:
        """States [m, 1] in the present frame of the tracking."""
        positions = rotated(states[..., POSITION], self.rotation) + self.translation
        axes = rotated(states[..., AXIS], self.rotation)
        return jnp.concatenate([positions, axes], axis=-1)


def rotated(
    vectors: Float[Array, "*batch 3"], rotation: Float[Array, "3"]
) -> Float[Array, "*batch 3"]:
    """Vectors turned by a rotation vector [rad] (Rodrigues' formula)."""
    squared = squared_norm(rotation)
    around = jnp.broadcast_to(rotation, vectors.shape)
    first = jnp.cross(around, vectors)
    second = jnp.cross(around, first)
    return vectors + sinc(squared) * first + sinc(squared / 4.0) ** 2 / 2.0 * second


class SessionC2S(ForwardModel):
    """A forward model after a change of day.

    Planner and controller go on in sensed configurations.

    Attributes:
        inner: the model of the training, with the present slack.
        change: since then.
    """

    inner: ForwardModel
    change: DayChange

    @classmethod
    def of(cls, model: ForwardModel, change: DayChange) -> "SessionC2S":
        """A model after a change."""
        return cls(slackened(model, change.slack), change)

    @property
    def takes_payload(self) -> bool:
        return self.inner.takes_payload

    def start(self, sensed: Float[Array, "modules 3"]) -> Memory:
        return self.inner.start(self.change.moved(sensed))

    def observe(self, sensed: Float[Array, "modules 3"], memory: Memory) -> Memory:
        return self.inner.observe(self.change.moved(sensed), memory)

    def with_moments(
        self,
        disturbances: Disturbances,
        configurations: Float[Array, "*batch modules 3"],
        memory: Memory,
        before: Disturbances,
    ) -> Disturbances:
        moved = self.change.moved(configurations)
        return self.inner.with_moments(disturbances, moved, memory, before)

    def predict(
        self,
        configurations: Float[Array, "*batch modules 3"],
        memory: Memory,
        disturbances: Disturbances | None = None,
    ) -> Float[Array, "*batch modules 6"]:
        moved = self.change.moved(configurations)
        return self.change.seen(self.inner.predict(moved, memory, disturbances))

    def tensions(
        self,
        configurations: Float[Array, "*batch modules 3"],
        memory: Memory,
        disturbances: Disturbances | None = None,
    ) -> Float[Array, "*batch modules cables"]:
        moved = self.change.moved(configurations)
        return self.inner.tensions(moved, memory, disturbances)

    def cable_stiffnesses(self) -> Float[np.ndarray, " modules"] | None:
        return self.inner.cable_stiffnesses()

    def for_planning(self) -> "SessionC2S":
        return replace(self, inner=self.inner.for_planning())

    def near(
        self, configurations: Float[Array, "modules 3"], memory: Memory
    ) -> "SessionC2S":
        near = self.inner.near(self.change.moved(configurations), memory)
        return replace(self, inner=near)

    def predictive_std(
        self, configurations: Float[Array, "*batch modules 3"], memory: Memory
    ) -> Float[Array, "*batch modules"]:
        moved = self.change.moved(configurations)
        return self.inner.predictive_std(moved, memory)

    def extrapolation(
        self, configurations: Float[Array, "*batch modules 3"]
    ) -> Float[Array, "*batch"]:
        return self.inner.extrapolation(self.change.moved(configurations))
