"""A forward model on another day: the same arm, placed, homed or tensioned otherwise.

A change of day acts on a few physical quantities: the frame of the tracking; the offsets
of the sensed bends and the slack of the cables (homing, pretension); and the softness
of the modules. `SessionC2S` wraps the model of the training with them.
"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.kinematics.bends import (
    bends_from_configurations,
    configurations_from_bends,
    sinc,
    squared_norm,
)
from s2c2a.kinematics.chain import Vectors
from s2c2a.models.arrays import Actions, Configuration, ModuleBends, PerModule
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import (
    Configurations,
    ForwardModel,
    Memory,
    WrappedModel,
)
from s2c2a.models.trunk import Trunk
from s2c2a.spaces import AXIS, POSITION


class DayChange(eqx.Module):
    """What differs from the day of the training; zeros change nothing.

    Attributes:
        translation: of the tracking's frame [m], shape (3,).
        rotation: of the tracking's frame, a rotation vector [rad], shape (3,).
        offsets: added to the sensed bends [rad], shape (modules, 2).
        slack: length by which all cables of a module are longer, over their radius
            [rad], shape (modules,).
        softness: logarithm of the bending compliance over that of the training, shape
            (modules,). Only chain models use it, and the slack.
    """

    translation: Float[Array, "3"]
    rotation: Float[Array, "3"]
    offsets: ModuleBends
    slack: PerModule
    softness: PerModule

    @classmethod
    def none(cls, modules: int) -> "DayChange":
        """No change of an arm with so many modules."""
        nothing = jnp.zeros(modules)
        offsets = jnp.zeros((modules, 2))
        return cls(jnp.zeros(3), jnp.zeros(3), offsets, nothing, nothing)


def rotated(vectors: Vectors, rotation: Float[Array, "3"]) -> Vectors:
    """Vectors turned by a rotation vector [rad] (Rodrigues' formula)."""
    squared = squared_norm(rotation)
    around = jnp.broadcast_to(rotation, vectors.shape)
    first = jnp.cross(around, vectors)
    second = jnp.cross(around, first)
    return vectors + sinc(squared) * first + sinc(squared / 4.0) ** 2 / 2.0 * second


class SessionC2S(WrappedModel):
    """A forward model after a change of day.

    Planner and controller go on in sensed configurations.

    Attributes:
        trained: the model of the training, with the present slack.
        change: since then.
        error: of the tip with it [m], on other motion; the model states no less.
    """

    trained: ForwardModel
    change: DayChange
    error: Float[Array, ""]

    @classmethod
    def of(
        cls,
        model: ForwardModel,
        change: DayChange,
        error: float = 0.0,
        beyond: Actions | float = 0.0,
    ) -> "SessionC2S":
        """A model after a change; one without a trunk has neither slack nor softness.

        Args:
            model: of the training.
            change: since then.
            error: see the class.
            beyond: what cables move beyond the sensed bends, over their radius [rad].
        """

        def on_the_day(part):
            if not isinstance(part, Trunk):
                return part
            slack = change.slack[:, None] + beyond
            return replace(part, slack=slack, softness=jnp.exp(change.softness))

        trained = jax.tree.map(
            on_the_day, model, is_leaf=lambda part: isinstance(part, Trunk)
        )
        return cls(trained, change, jnp.asarray(error))

    @property
    def inner(self) -> ForwardModel:
        """See `WrappedModel`: the model of the training."""
        return self.trained

    def moved(self, configurations: Configurations) -> Configurations:
        """See `WrappedModel`: those that the arm had on the day of the training."""
        bends = bends_from_configurations(configurations)
        return configurations_from_bends(bends + self.change.offsets)

    def predict(
        self,
        configurations: Configurations,
        memory: Memory,
        disturbances: Disturbances | None = None,
    ) -> Float[Array, "*batch modules 6"]:
        moved = self.moved(configurations)
        states = self.inner.predict(moved, memory, disturbances)
        # in the present frame of the tracking
        turn = self.change.rotation
        positions = rotated(states[..., POSITION], turn) + self.change.translation
        axes = rotated(states[..., AXIS], turn)
        return jnp.concatenate([positions, axes], axis=-1)

    def predictive_std(
        self, configurations: Configurations, memory: Memory
    ) -> Float[Array, "*batch modules"]:
        std = super().predictive_std(configurations, memory)
        number = jnp.arange(1, std.shape[-1] + 1)
        return jnp.maximum(std, self.error * number / number[-1])

    def in_base(self) -> "SessionC2S":
        still = jnp.zeros(3)
        change = replace(self.change, translation=still, rotation=still)
        return replace(self, change=change)

    def to_base(self, seen: Vectors) -> Vectors:
        return rotated(seen - self.change.translation, -self.change.rotation)

    def for_planning(self) -> "SessionC2S":
        return replace(self, trained=self.trained.for_planning())

    def near(self, configurations: Configuration, memory: Memory) -> "SessionC2S":
        near = self.trained.near(self.moved(configurations), memory)
        return replace(self, trained=near)
