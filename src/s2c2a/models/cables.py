"""Cable transmission between motors and modules: hysteresis, creep and delay.

Friction in the cable housing causes backlash: the module side stays until the motor has
moved back by the width of the backlash. A weighted sum of play operators of several
widths models any such hysteresis loop (Prandtl-Ishlinskii model; Brokate and Sprekels,
Hysteresis and Phase Transitions, 1996, ch. 2). Slow low-pass filters model creep, the
last reading models delay. The only input is the sensed configuration.

Creep is a generalized Maxwell model (Findley, Lai and Onaran, Creep and Relaxation of
Nonlinear Viscoelastic Materials, 1976, ch. 5): all filters of a cable have weights of
one sign, whose sum is bounded. The step response is then monotone and bounded, so that
creep on motions slower than the training data stays within these bounds. Weights of
both signs would cancel on fast motions and add up on slow ones.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.arm.backlash import play
from s2c2a.models.arrays import Actions
from s2c2a.training.fit import Fixed

Inputs = Float[Array, "*batch modules inputs cables"]
Weights = Float[Array, "*parts times cables"]
MAX_CREEP = 0.5  # largest sum of the weights of one cable's filters
# in initial weights: largest part of `MAX_CREEP`, near which gradients vanish, and
# smallest share of a filter, which would otherwise never change
MAX_TOTAL = 0.95
MIN_SHARE = 0.02


class HysteresisMemory(NamedTuple):
    """Memory of the cable transmission, in units of the cable radius [rad].

    Attributes:
        plays: outputs of the play operators, shape (modules, widths, cables).
        crept: outputs of the slow filters, shape (modules, times, cables).
        last: the last displacements, shape (modules, cables).
    """

    plays: Float[Array, "*batch modules widths cables"]
    crept: Float[Array, "*batch modules times cables"]
    last: Actions


class Operators(Fixed):
    """Constants of the play operators and filters.

    Attributes:
        widths: half-widths of the play operators [rad], shape (widths,).
        shares: filter coefficient per control step, shape (times,).
    """

    widths: Float[Array, " widths"]
    shares: Float[Array, " times"]


class Viscoelasticity(eqx.Module):
    """Bounded weights of slow filters: MAX_CREEP tanh(total) softmax(spectrum).

    All weights of a cable have the sign of its total.

    Attributes:
        total: determines the sum of the weights, shape (*parts, 1, cables).
        spectrum: determines the distribution over the time constants, shape (*parts,
            times, cables).
    """

    total: Float[Array, "*parts 1 cables"]
    spectrum: Weights

    @classmethod
    def none(cls, modules: int, times: int, cables: int) -> "Viscoelasticity":
        """Weights of zero; training distributes them equally at first."""
        total = jnp.zeros((modules, 1, cables))
        return cls(total, jnp.zeros((modules, times, cables)))

    @classmethod
    def from_weights(cls, weights: Weights) -> "Viscoelasticity":
        """A model close to these weights; those against the sign of their sum are dropped."""
        sign = jnp.sign(jnp.sum(weights, axis=-2, keepdims=True))
        magnitudes = jnp.maximum(sign * weights, 0.0)
        sums = jnp.sum(magnitudes, axis=-2, keepdims=True)
        bounded = jnp.minimum(sums / MAX_CREEP, MAX_TOTAL)
        spread = magnitudes + MIN_SHARE * jnp.maximum(sums, MIN_SHARE)
        return cls(jnp.arctanh(sign * bounded), jnp.log(spread))

    @property
    def weights(self) -> Weights:
        """Weight of every filter."""
        if not self.spectrum.shape[-2]:
            return self.spectrum
        spectrum = jax.nn.softmax(self.spectrum, axis=-2)
        return MAX_CREEP * jnp.tanh(self.total) * spectrum


class Hysteresis(eqx.Module):
    """Weighted play operators, filters and the last displacement.

    Displacements are in units of the cable radius [rad].

    Attributes:
        operators: constants of the play operators and filters.
        play_weights: of the displacement, every play operator and the last
            displacement, before a softplus: the module moves with the motor or stays,
            never against it, shape (modules, widths + 2, cables).
        delay_weights: of the filters that model delay, which are the first ones, shape
            (modules, delays, cables).
        creep: weights of the other filters.
        engaged: whether gradients are those of cables that follow their motors, for
            planning: within the backlash the true gradient is zero, and the planner
            would stop.
        arrived: whether delays are left out, for planning: at a high control rate
            hardly anything moves within one step.
    """

    operators: Operators
    play_weights: Float[Array, "modules plays cables"]
    delay_weights: Float[Array, "modules delays cables"]
    creep: Viscoelasticity
    engaged: bool = eqx.field(static=True, default=False)
    arrived: bool = eqx.field(static=True, default=False)

    @property
    def delays(self) -> int:
        """Number of filters, from the first, that model delay instead of creep."""
        return self.delay_weights.shape[-2]

    def start(self, displacements: Actions) -> HysteresisMemory:
        """Memory at rest, in the middle of every play operator."""
        now = displacements[..., None, :]
        plays = jnp.repeat(now, len(self.operators.widths), axis=-2)
        crept = jnp.repeat(now, len(self.operators.shares), axis=-2)
        return HysteresisMemory(plays, crept, displacements)

    def advance(
        self, displacements: Actions, memory: HysteresisMemory
    ) -> HysteresisMemory:
        """Memory after one more reading."""
        now = displacements[..., None, :]
        half = self.operators.widths[:, None]
        plays = play(memory.plays, now - half, now + half)
        if self.engaged:
            plays = now + jax.lax.stop_gradient(plays - now)
        crept = memory.crept + self.operators.shares[:, None] * (now - memory.crept)
        return HysteresisMemory(plays, crept, displacements)

    def inputs(self, displacements: Actions, memory: HysteresisMemory) -> Array:
        """Inputs of the weighted sum, from a reading and the memory before it.

        Returns:
            Shape (*batch, modules, widths + 2 + times, cables).
        """
        after = self.advance(displacements, memory)
        now = displacements[..., None, :]
        last = memory.last[..., None, :]
        return jnp.concatenate([now, after.plays, last, after.crept], axis=-2)

    def without_delay(self, inputs: Inputs) -> Array:
        """Inputs after the last displacement and the delay filters have settled."""
        first = len(self.operators.widths) + 1
        settled = jnp.repeat(inputs[..., :1, :], 1 + self.delays, axis=-2)
        plays = inputs[..., :first, :]
        creep = inputs[..., first + 1 + self.delays :, :]
        return jnp.concatenate([plays, settled, creep], axis=-2)

    def transmitted(self, inputs: Inputs) -> Array:
        """Displacements at the modules [rad], shape (*batch, modules, cables)."""
        plays = jax.nn.softplus(self.play_weights)
        parts = [plays, self.delay_weights, self.creep.weights]
        weights = jnp.concatenate(parts, axis=-2)
        return jnp.sum(weights * inputs, axis=-2)
