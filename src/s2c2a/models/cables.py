"""Cable transmission between motors and modules: hysteresis, creep and delay.

Friction in the cable housing causes backlash: the module side stays until the motor has
moved back by the width of the backlash. A weighted sum of play operators of several
widths models any such hysteresis loop (Prandtl-Ishlinskii model; Brokate and Sprekels,
Hysteresis and Phase Transitions, 1996, ch. 2). Slow low-pass filters model creep, the
last reading models delay. The only input is the sensed configuration.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.training.fit import Fixed


class HysteresisMemory(NamedTuple):
    """Memory of the cable transmission.

    Attributes:
        plays: outputs of the play operators, shape (modules, widths, cables).
        crept: outputs of the slow filters, shape (modules, times, cables).
        last: the last displacements, shape (modules, cables).
    """

    plays: Float[Array, "*batch modules widths cables"]
    crept: Float[Array, "*batch modules times cables"]
    last: Float[Array, "*batch modules cables"]


class Operators(Fixed):
    """Constants of the play operators and filters.

    Attributes:
        widths: half-widths of the play operators [rad], shape (widths,).
        shares: filter coefficient per control step, shape (times,).
    """

    widths: Float[Array, " widths"]
    shares: Float[Array, " times"]


class Hysteresis(eqx.Module):
    """Weighted play operators, filters and the last displacement.

    Displacements are in units of the cable radius [rad].

    Attributes:
        operators: constants of the play operators and filters.
        play_weights: of the displacement, every play operator and the last
            displacement, before a softplus: the module moves with the motor or stays,
            never against it, shape (modules, widths + 2, cables).
        creep_weights: of every filter, shape (modules, times, cables).
        delays: number of filters, from the first, that model delay instead of creep.
        engaged: whether gradients are those of cables that follow their motors, for
            planning: within the backlash the true gradient is zero, and the planner
            would stop.
        arrived: whether delays are left out, for planning: at a high control rate
            hardly anything moves within one step.
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
        """Memory at rest, in the middle of every play operator."""
        now = displacements[..., None, :]
        plays = jnp.repeat(now, len(self.operators.widths), axis=-2)
        crept = jnp.repeat(now, len(self.operators.shares), axis=-2)
        return HysteresisMemory(plays, crept, displacements)

    def advance(
        self,
        displacements: Float[Array, "*batch modules cables"],
        memory: HysteresisMemory,
    ):
        """Memory after one more reading."""
        now = displacements[..., None, :]
        half = self.operators.widths[:, None]
        plays = jnp.clip(memory.plays, now - half, now + half)
        if self.engaged:
            plays = now + jax.lax.stop_gradient(plays - now)
        crept = memory.crept + self.operators.shares[:, None] * (now - memory.crept)
        return HysteresisMemory(plays, crept, displacements)

    def inputs(
        self,
        displacements: Float[Array, "*batch modules cables"],
        memory: HysteresisMemory,
    ) -> Array:
        """Inputs of the weighted sum, from a reading and the memory before it.

        Returns:
            Shape (*batch, modules, widths + 2 + times, cables).
        """
        after = self.advance(displacements, memory)
        now = displacements[..., None, :]
        last = memory.last[..., None, :]
        return jnp.concatenate([now, after.plays, last, after.crept], axis=-2)

    def without_delay(
        self, inputs: Float[Array, "*batch modules inputs cables"]
    ) -> Array:
        """Inputs after the last displacement and the delay filters have settled."""
        first = len(self.operators.widths) + 1
        settled = jnp.repeat(inputs[..., :1, :], 1 + self.delays, axis=-2)
        plays = inputs[..., :first, :]
        creep = inputs[..., first + 1 + self.delays :, :]
        return jnp.concatenate([plays, settled, creep], axis=-2)

    def transmitted(
        self, inputs: Float[Array, "*batch modules inputs cables"]
    ) -> Array:
        """Displacements at the modules [rad], shape (*batch, modules, cables)."""
        weights = jnp.concatenate(
            [jax.nn.softplus(self.play_weights), self.creep_weights], axis=-2
        )
        return jnp.sum(weights * inputs, axis=-2)
