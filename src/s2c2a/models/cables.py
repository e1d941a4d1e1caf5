"""What cables make of their motors' motion, and how far a module bends when they only pull, and stretch.

Play is what friction in a housing tube does: the module's side stays where it is until the motor has gone so far back.
Operators of several widths, weighted, make up any such loop (the Prandtl-Ishlinskii basis; Brokate and Sprekels,
Hysteresis and Phase Transitions, 1996, ch. 2). Creep is the same with slow filters, lag with the last reading. All of
it is told from the sensed configurations alone.

Cable i of a module wants the bend that its displacement a_i = r B_i b stands for; where it is taut it pulls with its
stiffness k. In units of the module's own bending stiffness, kappa = k r^2 L / EI, the bend beta at rest solves

    beta + kappa sum_i B_i max(0, B_i beta - a_i / r + tau) = m

with m the moment of everything else (gravity, neighbours) and tau what a cable is taut by at rest.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.training.fit import Fixed

ITERATIONS = 6  # of taut cables found, bend solved; the energy is convex and piecewise quadratic
SHARES = (1.0, 0.6, 0.35, 0.2)  # of such a step; of five cables and more, whole ones can go round in a circle


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
        play_weights: of the displacement itself, every play, and the last displacement, before a softplus: what
            reaches the module moves with the motor or stays, never against it, shape (modules, widths + 2, cables).
        creep_weights: of every filter, shape (modules, times, cables).
        engaged: whether slopes are those of cables that follow their motors. A planner takes them: within a play
            nothing moves, and from the true slope, zero, it would never learn that going on helps.
    """

    operators: Operators
    play_weights: Float[Array, "modules plays cables"]
    creep_weights: Float[Array, "modules times cables"]
    engaged: bool = eqx.field(static=True, default=False)

    def start(self, displacements: Float[Array, "*batch modules cables"]) -> HysteresisMemory:
        """Memory at rest: in the middle of every play."""
        plays = jnp.repeat(displacements[..., None, :], len(self.operators.widths), axis=-2)
        crept = jnp.repeat(displacements[..., None, :], len(self.operators.shares), axis=-2)
        return HysteresisMemory(plays, crept, displacements)

    def advance(self, displacements: Float[Array, "*batch modules cables"], memory: HysteresisMemory):
        """Memory after one more reading."""
        band = displacements[..., None, :]
        half = self.operators.widths[:, None]
        plays = jnp.clip(memory.plays, band - half, band + half)
        if self.engaged:
            plays = band + jax.lax.stop_gradient(plays - band)
        crept = memory.crept + self.operators.shares[:, None] * (band - memory.crept)
        return HysteresisMemory(plays, crept, displacements)

    def inputs(self, displacements: Float[Array, "*batch modules cables"], memory: HysteresisMemory) -> Array:
        """All that is weighted, shape (*batch, modules, widths + 2 + times, cables), given the memory before."""
        after = self.advance(displacements, memory)
        now, last = displacements[..., None, :], memory.last[..., None, :]
        return jnp.concatenate([now, after.plays, last, after.crept], axis=-2)

    def transmitted(self, inputs: Float[Array, "*batch modules inputs cables"]) -> Array:
        """Displacements at the modules [rad], shape (*batch, modules, cables)."""
        weights = jnp.concatenate([jax.nn.softplus(self.play_weights), self.creep_weights], axis=-2)
        return jnp.sum(weights * inputs, axis=-2)


def bend_at_rest(
    displacements: Float[Array, "*batch modules cables"],
    moments: Float[Array, "*batch modules 2"],
    matrices: Float[Array, "modules cables 2"],
    stiffness: Float[Array, " modules"],
    tautness: Float[Array, " modules"],
    engaged: bool = False,
) -> Float[Array, "*batch modules 2"]:
    """Bend vectors [rad] at rest.

    Args:
        displacements: at the module, over the cable radius [rad].
        moments: of everything else, over the bending stiffness [rad].
        matrices: B.
        stiffness: kappa.
        tautness: tau [rad].
        engaged: take slopes as if every cable were taut. Where one cable holds a module alone, the others can move
            without effect, and a planner with true slopes would not find that they matter later.
    """
    wanted = displacements - tautness[:, None]
    every = jnp.broadcast_to(stiffness[:, None], wanted.shape)
    if engaged:
        matrices, stiffness = jax.lax.stop_gradient((matrices, stiffness))
    linear = _solve(every, wanted, moments, matrices)
    stretched = _stretched(*jax.lax.stop_gradient((linear, wanted, moments, matrices, stiffness)))
    bends = _solve(stretched * stiffness[:, None], wanted, moments, matrices)
    return linear + jax.lax.stop_gradient(bends - linear) if engaged else bends


def shortening(
    bends: Float[Array, "*batch modules 2"],
    displacements: Float[Array, "*batch modules cables"],
    matrices: Float[Array, "modules cables 2"],
    stiffness: Float[Array, " modules"],
    give: Float[Array, " modules"],
) -> Float[Array, "*batch modules 1"]:
    """How much shorter the centre line is, over the cable radius, on a cable's way from the base to each module.

    A module is as much shorter as all cables pull that run through it: its own and those of modules further out.

    Args:
        bends: at rest [rad].
        displacements: at the module, less what it is taut by [rad].
        matrices: B.
        stiffness: kappa.
        give: of each module, for a pull of one.
    """
    pulls = stiffness * jnp.sum(jnp.maximum(jnp.einsum("mnk,...mk->...mn", matrices, bends) - displacements, 0.0), -1)
    through = jnp.cumsum(pulls[..., ::-1], axis=-1)[..., ::-1]
    return jnp.cumsum(give * through, axis=-1)[..., None]


def _stretched(bends, wanted, moments, matrices, stiffness) -> Array:
    """Which cables pull at rest: Newton's steps, each shortened to the share with the least energy."""

    def stretches(bends):
        return jnp.einsum("mnk,...mk->...mn", matrices, bends) - wanted

    def energy(bends):
        pulled = stiffness * jnp.sum(jnp.maximum(stretches(bends), 0.0) ** 2, axis=-1)
        return (jnp.sum(bends**2, axis=-1) + pulled) / 2.0 - jnp.sum(moments * bends, axis=-1)

    def on(_, bends):
        step = _solve((stretches(bends) > 0.0) * stiffness[:, None], wanted, moments, matrices) - bends
        tried = jnp.stack([bends + share * step for share in SHARES])
        best = jnp.argmin(energy(tried), axis=0)[None, ..., None]
        return jnp.take_along_axis(tried, best, axis=0)[0]

    return stretches(jax.lax.fori_loop(0, ITERATIONS, on, bends)) > 0.0


def _solve(pulls, wanted, moments, matrices) -> Array:
    """(I + sum_i p_i B_i B_i^T) beta = m + sum_i p_i B_i w_i, two by two."""
    x, y = matrices[..., 0], matrices[..., 1]
    xx, xy, yy = (jnp.sum(pulls * part, axis=-1) for part in (x * x, x * y, y * y))
    right = moments + jnp.einsum("mnk,...mn->...mk", matrices, pulls * wanted)
    first, second = right[..., 0], right[..., 1]
    determinant = (1.0 + xx) * (1.0 + yy) - xy**2
    solution = [(1.0 + yy) * first - xy * second, (1.0 + xx) * second - xy * first]
    return jnp.stack(solution, axis=-1) / determinant[..., None]
