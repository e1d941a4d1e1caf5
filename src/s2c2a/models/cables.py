"""What cables make of their motors' motion.

Play is what friction in a housing tube does: the module's side stays where it is until
the motor has gone so far back. Operators of several widths, weighted, make up any such
loop (the Prandtl-Ishlinskii basis; Brokate and Sprekels, Hysteresis and Phase
Transitions, 1996, ch. 2). Creep is the same with slow filters, lag with the last
reading. All of it is told from the sensed configurations alone.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.training.fit import Fixed


class HysteresisMemory(NamedTuple):
    """What the sensors' past left behind.

    Attributes:
        plays: outputs of the play operators, shape (modules, widths, cables).
        crept: outputs of the slow filters, shape (modules, times, cables).
        last: the last displacements, shape (modules, cables).
    """

    plays: Float[Array, "*batch modules widths cables"]
    crept: Float[Array, "*batch modules times cables"]
    last: Float[Array, "*batch modules cables"]


class Operators(Fixed):
    """What remembers.

    Attributes:
        widths: half-widths of the plays [rad], shape (widths,).
        shares: what every filter takes of its input in a control step, shape (times,).
    """

    widths: Float[Array, " widths"]
    shares: Float[Array, " times"]


class Hysteresis(eqx.Module):
    """Weighted plays, filters and the last displacement. Displacements are in units of the cable radius [rad].

    Attributes:
        operators: the plays and the filters.
        play_weights: of the displacement itself, every play, and the last displacement,
            before a softplus: what reaches the module moves with the motor or stays,
            never against it, shape (modules, widths + 2, cables).
        creep_weights: of every filter, shape (modules, times, cables).
        delays: how many of the filters, from the first, stand for delay and not for
            creep.
        engaged: whether slopes are those of cables that follow their motors. A planner
            takes them: within a play nothing moves, and from the true slope, zero, it
            would never learn that going on helps.
        arrived: whether delays are left out. A planner does: at a high rate hardly
            anything moves in one step.
    """

    operators: Operators
    play_weights: Float[Array, "modules plays cables"]
    creep_weights: Float[Array, "modules times cables"]
    delays: int = eqx.field(static=True, default=0)
    engaged: bool = eqx.field(static=True, default=False)
    arrived: bool = eqx.field(static=True, default=False)

    def start(
        self, displacements: Float[Array, "*batch modules cables"]
    ) -> HysteresisMemory:
        """Memory at rest: in the middle of every play."""
        plays = jnp.repeat(
            displacements[..., None, :], len(self.operators.widths), axis=-2
        )
        crept = jnp.repeat(
            displacements[..., None, :], len(self.operators.shares), axis=-2
        )
        return HysteresisMemory(plays, crept, displacements)

    def advance(
        self,
        displacements: Float[Array, "*batch modules cables"],
        memory: HysteresisMemory,
    ):
        """Memory after one more reading."""
        band = displacements[..., None, :]
        half = self.operators.widths[:, None]
        plays = jnp.clip(memory.plays, band - half, band + half)
        if self.engaged:
            plays = band + jax.lax.stop_gradient(plays - band)
        crept = memory.crept + self.operators.shares[:, None] * (band - memory.crept)
        return HysteresisMemory(plays, crept, displacements)

    def inputs(
        self,
        displacements: Float[Array, "*batch modules cables"],
        memory: HysteresisMemory,
    ) -> Array:
        """All that is weighted, shape (*batch, modules, widths + 2 + times, cables), given the memory before."""
        after = self.advance(displacements, memory)
        now = displacements[..., None, :]
        last = memory.last[..., None, :]
        return jnp.concatenate([now, after.plays, last, after.crept], axis=-2)

    def without_delay(
        self, inputs: Float[Array, "*batch modules inputs cables"]
    ) -> Array:
        """The same once the last displacement and the filters of delay have come to where the motors are."""
        last = len(self.operators.widths) + 1
        now = jnp.broadcast_to(
            inputs[..., :1, :], (*inputs.shape[:-2], 1 + self.delays, inputs.shape[-1])
        )
        return jnp.concatenate(
            [inputs[..., :last, :], now, inputs[..., last + 1 + self.delays :, :]],
            axis=-2,
        )

    def transmitted(
        self, inputs: Float[Array, "*batch modules inputs cables"]
    ) -> Array:
        """Displacements at the modules [rad], shape (*batch, modules, cables)."""
        weights = jnp.concatenate(
            [jax.nn.softplus(self.play_weights), self.creep_weights], axis=-2
        )
        return jnp.sum(weights * inputs, axis=-2)
