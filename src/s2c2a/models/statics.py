"""Static equilibrium of modules with elastic cables that pull and never push.

A cable with displacement a_i = r B_i b is taut if the module bends less than b; it then
pulls with its stiffness k. In units of the module's bending stiffness, kappa =
k r^2 L / EI, the bend beta at equilibrium solves

    beta + kappa sum_i B_i max(0, B_i beta - a_i / r + tau) = m

with m the moment of everything else (gravity, neighbors) and tau the pretension of the
cables, as a displacement.

Cables also act on other modules. All cables that run through a module shorten it, which
slackens the cables of the modules beyond it. Where cables of outer modules run beside
the axis of an inner one, its bend changes their path length, and their pull bends it. A
fixed-point iteration solves for these couplings and the bends together.

A viscoelastic module creeps towards the bends that it was held at: filters of past
cable displacements add a moment.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.models.arrays import Actions, Bends, Matrices, PerModule
from s2c2a.models.cables import Viscoelasticity

NEWTON_ITERATIONS = 6  # the energy is convex and piecewise quadratic
WARM_ITERATIONS = 2  # from bends near the equilibrium
# line search; with five cables and more, full Newton steps can cycle
STEP_LENGTHS = (1.0, 0.6, 0.35, 0.2)
INITIAL_STIFFNESS = 4.0
"""Largest kappa before the training: the stiffness of cables that hardly yield is seldom
known, and a start from 34 to 45 costs 40 % of accuracy on a recorded trunk."""
SWEEPS = 2  # of the fixed-point iteration between modules, for the same moments
INITIAL_AXIAL_COMPLIANCE = 0.1  # shortening over cable radius, for a pull of one
# of the logarithm of the shortening: on some arms it is a hundred times smaller, and
# training has to reach that
AXIAL_COMPLIANCE_UNIT = 30.0


class StaticState(NamedTuple):
    """State of the modules at equilibrium.

    Attributes:
        bends: [rad], shape (*batch, modules, 2).
        shortening: shortening of each module over the cable radius, shape (*batch,
            modules).
        slack: of its cables from the shortening of inner modules, over the cable
            radius, shape (*batch, modules, 1).
        inner_bends: bends of inner modules that change the path of its cables [rad], shape
            (*batch, modules, 2).
        pulled: moments of outer modules' cables, over the bending stiffness [rad],
            shape (*batch, modules, 2).
        pulls: tension of every cable times its radius over the bending stiffness
            [rad], shape (*batch, modules, cables).
    """

    bends: Bends
    shortening: Float[Array, "*batch modules"]
    slack: Float[Array, "*batch modules 1"]
    inner_bends: Bends
    pulled: Bends
    pulls: Actions

    @classmethod
    def straight(cls, like: Actions) -> "StaticState":
        """A straight arm without tension, for as many modules and cables as `like`."""
        none = jnp.zeros((*like.shape[:-1], 2))
        no_slack = none[..., :1]
        return cls(none, none[..., 0], no_slack, none, none, jnp.zeros_like(like))


class Equilibrium(eqx.Module):
    """Learned parameters of the static equilibrium.

    The couplings assume modules of equal stiffness and cable radius; learned parameters
    compensate for differences.

    Attributes:
        log_stiffness: logarithm of kappa, shape (modules,).
        tautness: tau [rad], shape (modules,).
        log_axial_compliance: logarithm of the shortening for a pull of one, over
            `AXIAL_COMPLIANCE_UNIT`, shape (modules,).
        coupling: distance of outer modules' cables from the axis, in parts of their
            radius, shape (modules,).
        relaxation: weights of the moments toward former bends, shape (modules, times, 1).
    """

    log_stiffness: PerModule
    tautness: PerModule
    log_axial_compliance: PerModule
    coupling: PerModule
    relaxation: Viscoelasticity

    @classmethod
    def untrained(cls, arm: ArmSpec, times: int) -> "Equilibrium":
        """Initial parameters: modules shorten, with no other coupling and no creep."""
        geometry = ArmGeometry.of(arm)
        springs = per_module(arm, "cable.stiffness") * geometry.cable_radii**2
        kappa = springs * geometry.lengths / per_module(arm, "bending_stiffness")
        modules = arm.module_count
        return cls(
            log_stiffness=jnp.log(jnp.minimum(kappa, INITIAL_STIFFNESS)),
            tautness=jnp.zeros(modules),
            log_axial_compliance=jnp.full(
                modules, np.log(INITIAL_AXIAL_COMPLIANCE) / AXIAL_COMPLIANCE_UNIT
            ),
            coupling=jnp.zeros(modules),
            relaxation=Viscoelasticity.none(modules, times, 1),
        )

    def sweep(
        self,
        transmitted: Actions,
        moments: Bends,
        matrices: Matrices,
        softness: Float[Array, "modules 1"],
        rest: StaticState,
        engaged: bool,
        is_first: Bool[Array, ""] | bool,
    ) -> StaticState:
        """Advance the fixed-point iteration between modules by one step.

        Args:
            transmitted: displacements at the modules, over the cable radius [rad].
            moments: of everything else, over the bending stiffness [rad].
            matrices: B.
            softness: bending compliance over that of the training.
            rest: the result of the last step.
            engaged: see `bend_at_rest`. The couplings then have no gradient: together
                with gradients that are not the true ones, it would have the wrong sign.
            is_first: whether there was none, so that its bends are no start.
        """
        stiffness = jnp.exp(self.log_stiffness) * softness[:, 0]
        compliance = jnp.exp(self.log_axial_compliance * AXIAL_COMPLIANCE_UNIT)
        path_change = jnp.einsum("mnk,...mk->...mn", matrices, rest.inner_bends)
        displacements = transmitted + rest.slack - path_change
        bends = bend_at_rest(
            displacements,
            moments - rest.pulled,
            matrices,
            stiffness,
            self.tautness,
            engaged,
            rest.bends,
            is_first,
        )
        needed = jnp.einsum("mnk,...mk->...mn", matrices, bends)
        stretch = needed - displacements + self.tautness[:, None]
        is_cable = jnp.any(matrices != 0.0, axis=-1)  # modules have different numbers
        pulls = jnp.where(is_cable, stiffness[:, None] * jnp.maximum(stretch, 0.0), 0.0)
        shortening = compliance * _sum_outwards(jnp.sum(pulls, axis=-1), axis=-1)
        # the mean with the last sweep, against oscillation
        slack = (rest.slack + jnp.cumsum(shortening, axis=-1)[..., None]) / 2.0
        inner_bends = self.coupling[:, None] * bends
        inner_bends = jnp.cumsum(inner_bends, axis=-2) - inner_bends
        own = jnp.einsum("mnk,...mn->...mk", matrices, pulls)
        pulled = self.coupling[:, None] * (_sum_outwards(own, axis=-2) - own)
        couplings = shortening, slack, inner_bends, pulled, pulls
        if engaged:
            couplings = jax.lax.stop_gradient(couplings)
        return StaticState(bends, *couplings)


def _sum_outwards(values: Array, axis: int) -> Array:
    """Sum over each module and all modules beyond it."""
    return jnp.flip(jnp.cumsum(jnp.flip(values, axis), axis), axis)


def bend_at_rest(
    displacements: Actions,
    moments: Bends,
    matrices: Matrices,
    stiffness: PerModule,
    tautness: PerModule,
    engaged: bool = False,
    start: Bends | float = 0.0,
    is_first: Bool[Array, ""] | bool = True,
) -> Bends:
    """Bend vectors at static equilibrium [rad].

    Args:
        displacements: at the module, over the cable radius [rad].
        moments: of everything else, over the bending stiffness [rad].
        matrices: B.
        stiffness: kappa.
        tautness: tau [rad].
        engaged: use gradients as if every cable were taut. Where one cable alone holds
            a module, the others move without effect, and a planner with true gradients
            would not see that they matter later.
        start: bends near the equilibrium.
        is_first: whether none are known, and `start` means nothing.
    """
    desired = displacements - tautness[:, None]
    all_taut = jnp.broadcast_to(stiffness[:, None], desired.shape)
    if engaged:
        matrices, stiffness = jax.lax.stop_gradient((matrices, stiffness))
    linear = _solve_bends(all_taut, desired, moments, matrices)
    iterations = jnp.where(is_first, NEWTON_ITERATIONS, WARM_ITERATIONS)
    initial = jnp.where(is_first, linear, start)
    constants = jax.lax.stop_gradient((initial, desired, moments, matrices, stiffness))
    taut = _find_taut_cables(*constants, iterations)
    bends = _solve_bends(taut * stiffness[:, None], desired, moments, matrices)
    if engaged:
        return linear + jax.lax.stop_gradient(bends - linear)
    return bends


def _find_taut_cables(
    bends, desired, moments, matrices, stiffness, iterations: Array
) -> Array:
    """Which cables are taut at equilibrium, by Newton's method with a line search."""

    def stretches(bends):
        return jnp.einsum("mnk,...mk->...mn", matrices, bends) - desired

    def energy(bends):
        stretched = jnp.sum(jnp.maximum(stretches(bends), 0.0) ** 2, axis=-1)
        elastic = (jnp.sum(bends**2, axis=-1) + stiffness * stretched) / 2.0
        return elastic - jnp.sum(moments * bends, axis=-1)

    def iterate(_, bends):
        taut = stretches(bends) > 0.0
        solution = _solve_bends(taut * stiffness[:, None], desired, moments, matrices)
        step = solution - bends
        trials = jnp.stack([bends + length * step for length in STEP_LENGTHS])
        best = jnp.argmin(energy(trials), axis=0)[None, ..., None]
        return jnp.take_along_axis(trials, best, axis=0)[0]

    return stretches(jax.lax.fori_loop(0, iterations, iterate, bends)) > 0.0


def _solve_bends(stiffnesses, desired, moments, matrices) -> Array:
    """Solve (I + sum_i p_i B_i B_i^T) beta = m + sum_i p_i B_i w_i, two by two."""
    x = matrices[..., 0]
    y = matrices[..., 1]
    xx = 1.0 + jnp.sum(stiffnesses * (x * x), axis=-1)
    xy = jnp.sum(stiffnesses * (x * y), axis=-1)
    yy = 1.0 + jnp.sum(stiffnesses * (y * y), axis=-1)
    forces = stiffnesses * desired
    right = moments + jnp.einsum("mnk,...mn->...mk", matrices, forces)
    first = right[..., 0]
    second = right[..., 1]
    solution = [yy * first - xy * second, xx * second - xy * first]
    return jnp.stack(solution, axis=-1) / (xx * yy - xy**2)[..., None]
