"""How far modules bend when cables only pull, and stretch; and what each does to the others.

Cable i of a module wants the bend that its displacement a_i = r B_i b stands for; where
it is taut it pulls with its stiffness k. In units of the module's own bending
stiffness, kappa = k r^2 L / EI, the bend beta at rest solves

    beta + kappa sum_i B_i max(0, B_i beta - a_i / r + tau) = m

with m the moment of everything else (gravity, neighbors) and tau what a cable is taut
by at rest.

Cables pull on more than their own module. The center line gets shorter with all that
runs through it, so that every cable further out is let go by as much; and where cables
of outer modules run beside the axis of an inner one, its bend takes of their way, and
their pull bends it. Both are brought together with the bends, a little at a time.

A body that relaxes gives way to a bend that it was held at: moments of the bends that
cables asked for, as filters remember them.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

# of taut cables found, bend solved; the energy is convex and piecewise quadratic
ITERATIONS = 6
# of such a step; of five cables and more, whole ones can go round in a circle
SHARES = (1.0, 0.6, 0.35, 0.2)
NEARLY = 2  # of such steps, where they are nearly at rest
# times that bends and what modules do to each other are brought together, in one call
SWEEPS = 2
FIRST_STIFFNESS = 4.0  # kappa before training
FIRST_GIVE = 0.1  # of a module's length over the cable radius, for a pull of one
# of its logarithm: on some arms it is a hundred times smaller, and training has to get
# there
GIVE_UNIT = 30.0


class Rest(NamedTuple):
    """Modules at rest, as far as they are brought together.

    Attributes:
        bends: [rad], shape (*batch, modules, 2).
        shorter: each module, over the cable radius, shape (*batch, modules).
        slack: what the way of its cables is shorter by, over the cable radius, shape
            (*batch, modules, 1).
        led: bends of inner modules that take of that way [rad], shape (*batch, modules,
            2).
        pulled: moments of outer modules' cables, over the bending stiffness [rad], the
            same shape.
        pulls: of every cable, times its radius over the bending stiffness [rad], shape
            (*batch, modules, cables).
    """

    bends: Float[Array, "*batch modules 2"]
    shorter: Float[Array, "*batch modules"]
    slack: Float[Array, "*batch modules 1"]
    led: Float[Array, "*batch modules 2"]
    pulled: Float[Array, "*batch modules 2"]
    pulls: Float[Array, "*batch modules cables"]


class Equilibrium(eqx.Module):
    """What a module's rest depends on.

    What modules do to each other is said as if they were alike in stiffness and cable
    radius; what is learned makes up for the rest.

    Attributes:
        log_stiffness: logarithm of kappa, shape (modules,).
        tautness: tau, shape (modules,).
        log_give: logarithm of how much modules become shorter for a pull of one, over
            its unit, shape (modules,).
        coupling: at what part of their radius outer modules' cables run through it,
            shape (modules,).
        relaxing: of the moments that bends leave which cables asked for, by filter,
            shape (modules, times).
    """

    log_stiffness: Float[Array, " modules"]
    tautness: Float[Array, " modules"]
    log_give: Float[Array, " modules"]
    coupling: Float[Array, " modules"]
    relaxing: Float[Array, "modules times"]

    @classmethod
    def untrained(cls, modules: int, times: int) -> "Equilibrium":
        """Before anything is learned: modules that do nothing to each other but get shorter."""
        give = jnp.full(modules, np.log(FIRST_GIVE) / GIVE_UNIT)
        zeros = jnp.zeros(modules)
        return cls(
            jnp.full(modules, np.log(FIRST_STIFFNESS)),
            zeros,
            give,
            zeros,
            jnp.zeros((modules, times)),
        )

    def settled(
        self,
        carried: Float[Array, "*batch modules cables"],
        moments: Float[Array, "*batch modules 2"],
        matrices: Float[Array, "modules cables 2"],
        before: Rest | None,
        engaged: bool,
    ) -> Rest:
        """Nearer to rest than before.

        Args:
            carried: displacements at the modules, over the cable radius [rad].
            moments: of everything else, over the bending stiffness [rad].
            matrices: B.
            before: what was known of it, if anything.
            engaged: see `bend_at_rest`. What modules do to each other has no slope
                then: together with slopes that are not the true ones it would turn them
                round.
        """
        stiffness = jnp.exp(self.log_stiffness)
        give = jnp.exp(self.log_give * GIVE_UNIT)
        none = jnp.zeros((*carried.shape[:-1], 2))
        known = before is not None
        rest = before or Rest(
            none, none[..., 0], none[..., :1], none, none, jnp.zeros_like(carried)
        )
        for sweep in range(SWEEPS):
            start = rest.bends if known or sweep else None
            displaced = (
                carried
                + rest.slack
                - jnp.einsum("mnk,...mk->...mn", matrices, rest.led)
            )
            bends = bend_at_rest(
                displaced,
                moments - rest.pulled,
                matrices,
                stiffness,
                self.tautness,
                engaged,
                start,
            )
            stretched = (
                jnp.einsum("mnk,...mk->...mn", matrices, bends)
                - displaced
                + self.tautness[:, None]
            )
            pulls = stiffness[:, None] * jnp.maximum(stretched, 0.0)
            shorter = give * _and_outer(jnp.sum(pulls, axis=-1), axis=-1)
            # half, lest it swings
            slack = (rest.slack + jnp.cumsum(shorter, axis=-1)[..., None]) / 2.0
            led = self.coupling[:, None] * bends
            own = jnp.einsum("mnk,...mn->...mk", matrices, pulls)
            pulled = self.coupling[:, None] * (_and_outer(own, axis=-2) - own)
            others = shorter, slack, jnp.cumsum(led, axis=-2) - led, pulled, pulls
            rest = Rest(bends, *(jax.lax.stop_gradient(others) if engaged else others))
        return rest


def _and_outer(values: Array, axis: int) -> Array:
    """Of each module, and all that are further out."""
    return jnp.flip(jnp.cumsum(jnp.flip(values, axis), axis), axis)


def bend_at_rest(
    displacements: Float[Array, "*batch modules cables"],
    moments: Float[Array, "*batch modules 2"],
    matrices: Float[Array, "modules cables 2"],
    stiffness: Float[Array, " modules"],
    tautness: Float[Array, " modules"],
    engaged: bool = False,
    start: Float[Array, "*batch modules 2"] | None = None,
) -> Float[Array, "*batch modules 2"]:
    """Bend vectors [rad] at rest.

    Args:
        displacements: at the module, over the cable radius [rad].
        moments: of everything else, over the bending stiffness [rad].
        matrices: B.
        stiffness: kappa.
        tautness: tau [rad].
        engaged: take slopes as if every cable were taut. Where one cable holds a module
            alone, the others can move without effect, and a planner with true slopes
            would not find that they matter later.
        start: bends nearly at rest, if they are known.
    """
    desired = displacements - tautness[:, None]
    every = jnp.broadcast_to(stiffness[:, None], desired.shape)
    if engaged:
        matrices, stiffness = jax.lax.stop_gradient((matrices, stiffness))
    linear = _solve(every, desired, moments, matrices)
    begun, iterations = (linear, ITERATIONS) if start is None else (start, NEARLY)
    stretched = _stretched(
        *jax.lax.stop_gradient((begun, desired, moments, matrices, stiffness)),
        iterations,
    )
    bends = _solve(stretched * stiffness[:, None], desired, moments, matrices)
    return linear + jax.lax.stop_gradient(bends - linear) if engaged else bends


def _stretched(bends, desired, moments, matrices, stiffness, iterations: int) -> Array:
    """Which cables pull at rest: Newton's steps, each shortened to the share with the least energy."""

    def stretches(bends):
        return jnp.einsum("mnk,...mk->...mn", matrices, bends) - desired

    def energy(bends):
        pulled = stiffness * jnp.sum(jnp.maximum(stretches(bends), 0.0) ** 2, axis=-1)
        return (jnp.sum(bends**2, axis=-1) + pulled) / 2.0 - jnp.sum(
            moments * bends, axis=-1
        )

    def on(_, bends):
        step = (
            _solve(
                (stretches(bends) > 0.0) * stiffness[:, None],
                desired,
                moments,
                matrices,
            )
            - bends
        )
        tried = jnp.stack([bends + share * step for share in SHARES])
        best = jnp.argmin(energy(tried), axis=0)[None, ..., None]
        return jnp.take_along_axis(tried, best, axis=0)[0]

    return stretches(jax.lax.fori_loop(0, iterations, on, bends)) > 0.0


def _solve(pulls, desired, moments, matrices) -> Array:
    """(I + sum_i p_i B_i B_i^T) beta = m + sum_i p_i B_i w_i, two by two."""
    x = matrices[..., 0]
    y = matrices[..., 1]
    xx, xy, yy = (jnp.sum(pulls * part, axis=-1) for part in (x * x, x * y, y * y))
    right = moments + jnp.einsum("mnk,...mn->...mk", matrices, pulls * desired)
    first = right[..., 0]
    second = right[..., 1]
    determinant = (1.0 + xx) * (1.0 + yy) - xy**2
    solution = [(1.0 + yy) * first - xy * second, (1.0 + xx) * second - xy * first]
    return jnp.stack(solution, axis=-1) / determinant[..., None]
