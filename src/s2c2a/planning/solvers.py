"""Solvers: from a problem to configurations; the planner keeps them within the arm's limits. And an arm's reach.

Few variables (two a module) and a forward model that is dear: in damped least squares
all directions of the Jacobian go through the model side by side, and a handful of steps
end nearer to the optimum than dozens of gradient steps.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, Int

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import TargetError
from s2c2a.goals import Goal
from s2c2a.kinematics import (
    bends_from_configurations,
    configurations_from_bends,
    limit_lengths,
    states_from_bends,
)
from s2c2a.components import Kind, Part
from s2c2a.planning.terms import (
    Bends,
    Candidate,
    Configurations,
    Residual,
    Situation,
    Term,
    norm,
)
from s2c2a.spaces import POSITION

Residuals = Callable[[Float[Array, "*variables"]], Float[Array, " residuals"]]
Projection = Callable[[Float[Array, "*variables"]], Float[Array, "*variables"]]

FIRST_DAMPING = 1e-2
AFTER_A_KEPT_STEP = 0.2
AFTER_A_REFUSED_STEP = 10.0
DAMPING_RANGE = (1e-6, 1e4)
IDLE_TURNS = 2
SLIGHT = 5e-4  # parts of a smaller sum of squares do not count: 5 mm off at the tip
REACH_ITERATIONS = 30
ON_AXIS = 1e-3  # of the arm's length: a point so near to the axis is on no side of it
# of bends against positions in units of the arm's length: keeps solutions from
# wandering
REST_WEIGHT = 1e-3


class _Step(NamedTuple):
    """Where the search stands: a point, the sum of squares there, and the normal equations."""

    point: Float[Array, "*variables"]
    cost: Float[Array, ""]
    gradient: Float[Array, " variables"]
    curvature: Float[Array, "variables variables"]
    damping: Float[Array, ""]


class _Turn(NamedTuple):
    """Where the loop stands: how many turns it made, how many of the last ones in a row were worth little, the step."""

    number: Int[Array, ""]
    idle: Int[Array, ""]
    step: _Step


def solve_least_squares(
    residuals: Residuals,
    start: Float[Array, "*variables"],
    project: Projection,
    iterations: Int[Array, ""] | int,
    enough: float = 0.0,
) -> tuple[Float[Array, "*variables"], Float[Array, ""]]:
    """Minimize the sum of squared residuals near a start.

    Each iteration solves (J^T J + lambda I) step = -J^T r, projects, and keeps the step
    only where the sum falls; lambda shrinks after a kept step and grows after a refused
    one.

    Args:
        residuals: variables -> residuals, differentiable.
        start: where to begin, of any shape; it is projected first.
        project: onto what is allowed; the identity where everything is.
        iterations: how many at most; below zero, and not even the start is looked at.
        enough: part of the sum; it ends when two steps in a row gain or promise less.
            With zero none are left out.

    Returns:
        The point, and the sum there; infinite where it was not looked at.
    """
    directions = jnp.eye(start.size)

    def linearized(point):
        def along(direction):
            return jax.jvp(residuals, (point,), (direction.reshape(start.shape),))

        return jax.vmap(along, out_axes=(None, 1))(directions)

    def iterate(turn: _Turn) -> _Turn:
        step = turn.step
        change = jnp.linalg.solve(
            step.curvature + step.damping * directions, step.gradient
        )
        point = project(step.point - change.reshape(start.shape))
        values, slopes = linearized(point)
        cost = jnp.sum(values**2)
        better = cost < step.cost
        damping = jnp.clip(
            step.damping * jnp.where(better, AFTER_A_KEPT_STEP, AFTER_A_REFUSED_STEP),
            *DAMPING_RANGE,
        )
        tried = _Step(point, cost, slopes.T @ values, slopes.T @ slopes, damping)
        kept = jax.tree.map(
            lambda new, old: jnp.where(better, new, old), tried, step
        )._replace(damping=damping)
        # or what was promised
        gained = jnp.where(
            better, step.cost - cost, 2.0 * jnp.vdot(step.gradient, change)
        )
        idle = jnp.where(gained < enough * (step.cost + SLIGHT), turn.idle + 1, 0)
        return _Turn(turn.number + 1, idle, kept)

    def goes_on(turn: _Turn) -> Bool[Array, ""]:
        return (turn.number <= iterations) & (turn.idle < IDLE_TURNS)

    # The first turn goes nowhere and looks at the start, so that the model stands once
    # in the program, not twice.
    nothing = jnp.zeros(start.size)
    damping = jnp.asarray(FIRST_DAMPING / AFTER_A_KEPT_STEP)
    begun = _Step(
        start, jnp.asarray(jnp.inf), nothing, jnp.zeros_like(directions), damping
    )
    zero = jnp.zeros((), jnp.int32)
    ended = jax.lax.while_loop(goes_on, iterate, _Turn(zero, zero, begun)).step
    return ended.point, ended.cost


class Problem(NamedTuple):
    """What is to be made small in a control step, in both forms that solvers ask for.

    Attributes:
        situation: what is fixed; `situation.last` is where to begin.
        terms: what candidates are judged by.
        look: (configurations, the same as bends) -> a candidate with what is predicted
            for it.
    """

    situation: Situation
    terms: tuple[Term, ...]
    look: Callable[[Configurations, Bends], Candidate]

    def sum_of_norms(self, configurations: Configurations) -> Float[Array, ""]:
        """The sum over all groups of mu |r| (Chen et al. 2025, eq. (7))."""
        judged = self._judged(
            self.look(configurations, bends_from_configurations(configurations))
        )
        return sum((jnp.sum(mu * norm(rows)) for mu, rows in judged), jnp.zeros(()))

    def stacked(self, bends: Bends) -> Float[Array, " residuals"]:
        """All r times the root of mu, one behind the other: least squares of them are the least sum of mu |r|^2."""
        return self._residuals(self.looked_at(bends))

    def _residuals(self, candidate: Candidate) -> Float[Array, " residuals"]:
        judged = self._judged(candidate)
        return jnp.concatenate(
            [
                (jnp.sqrt(jnp.asarray(mu))[..., None] * rows).reshape(-1)
                for mu, rows in judged
            ]
        )

    def looked_at(self, bends: Bends) -> Candidate:
        """The candidate with these bends."""
        return self.look(configurations_from_bends(bends), bends)

    def judged(self, candidate: Candidate) -> Float[Array, ""]:
        """Its sum of mu |r|^2."""
        return jnp.sum(self._residuals(candidate) ** 2)

    def asking(self, goal: Goal) -> "Problem":
        """The same for another goal."""
        return self._replace(situation=self.situation._replace(goal=goal))

    def within_limits(self, desired: Configurations) -> Configurations:
        """Bends within their limits, and no further than a step from the last ones.

        The angle between two configurations is never more than the distance of their
        bends. Vectors that are not of unit length have no bend limits.
        """
        situation = self.situation
        if not situation.on_sphere:
            last = situation.last.configurations
            return last + limit_lengths(desired - last, situation.longest_step)
        allowed = limit_lengths(
            bends_from_configurations(desired), situation.bend_limits
        )
        return configurations_from_bends(self.within_step(allowed))

    def within_step(self, bends: Bends) -> Bends:
        """No further than a step from the last ones."""
        start = self.situation.last.bends
        return start + limit_lengths(bends - start, self.situation.longest_step)

    def _judged(self, candidate: Candidate) -> list[Residual]:
        return [term.residual(candidate, self.situation) for term in self.terms]


@dataclass(frozen=True)
class Solver(Part, ABC):
    """Finds the next configurations; traced by JAX, so its work must not depend on values."""

    @abstractmethod
    def solve(self, problem: Problem) -> Configurations:
        """Configurations that make the problem small, shape (modules, 3), module frames."""


@dataclass(frozen=True)
class Adam(Solver):
    """Adam on the sum of norms, from the last configuration (Chen et al. 2025, sec. III-A: 0.02, 10 iterations).

    Where configurations are of unit length, each module's vector returns to it after
    every iteration.

    Attributes:
        learning_rate: of Adam.
        iterations: in a control step.
    """

    learning_rate: float = 0.02
    iterations: int = 10

    def solve(self, problem: Problem) -> Configurations:
        """See `Solver`."""
        optimizer = optax.adam(self.learning_rate)
        gradient = jax.grad(problem.sum_of_norms)
        on_sphere = problem.situation.on_sphere
        start = problem.situation.last.configurations

        def iterate(_, carry):
            configurations, state = carry
            updates, state = optimizer.update(gradient(configurations), state)
            moved = configurations + updates
            return moved / norm(moved)[:, None] if on_sphere else moved, state

        return jax.lax.fori_loop(
            0, self.iterations, iterate, (start, optimizer.init(start))
        )[0]


@dataclass(frozen=True)
class LeastSquares(Solver):
    """Damped least squares on bends (Levenberg and Marquardt); every iterate stays within the step.

    Attributes:
        iterations: in a control step, at most.
        enough: part of the cost; no more is done when two iterations in a row gain
            less.
    """

    iterations: int = 20
    enough: float = 1e-4

    def solve(self, problem: Problem) -> Configurations:
        """See `Solver`."""
        start = problem.situation.last.bends
        bends, _ = solve_least_squares(
            problem.stacked, start, problem.within_step, self.iterations, self.enough
        )
        return configurations_from_bends(bends)


SOLVERS = Kind.of("solver", Solver, Adam, LeastSquares)


def reach_gaps(
    arm: ArmSpec, positions: Float[np.ndarray, "points 3"], module: int = -1
) -> Float[np.ndarray, " points"]:
    """Distance from desired positions to the nearest end that the arm can bring a module to [m].

    The arm is taken as constant-curvature arcs within its bend limits, so a true arm
    differs a little at the edge.

    Args:
        arm: the arm.
        positions: desired positions [m], base frame.
        module: whose end shall go there.

    Raises:
        TargetError: no such module.
    """
    count = arm.module_count
    if not -count <= module < count:
        raise TargetError(
            f"no module {module}; '{arm.name}' has {count}, from 0 at the base to {count - 1}, or -1"
        )
    last = range(count)[module] + 1
    geometry = ArmGeometry.of(arm)
    lengths = jnp.asarray(geometry.lengths[:last], dtype=jnp.float32)
    limits = jnp.asarray(geometry.bend_limits[:last], dtype=jnp.float32)
    return np.asarray(_gaps(jnp.asarray(positions, dtype=jnp.float32), lengths, limits))


@jax.jit
def _gaps(positions, lengths, limits):
    size = jnp.sum(lengths)

    def end(bends):
        return states_from_bends(bends, lengths)[-1, POSITION]

    def project(bends):
        return limit_lengths(bends, limits)

    def gap(position, start):
        def residuals(bends):
            return jnp.concatenate(
                [(end(bends) - position) / size, REST_WEIGHT * bends.reshape(-1)]
            )

        bends, _ = solve_least_squares(residuals, start, project, REACH_ITERATIONS)
        return jnp.linalg.norm(end(bends) - position)

    def least(position):
        """From shapes towards the point: all modules alike, and the lower half alone.

        On the arm's axis any side will do, but some side is needed: a straight arm
        would stay straight.
        """
        aside = jnp.linalg.norm(position[:2])
        towards = jnp.where(
            aside > ON_AXIS * size,
            position[:2] / jnp.maximum(aside, ON_AXIS * size),
            jnp.eye(2)[0],
        )
        alike = 0.5 * limits[:, None] * towards
        lower = alike * (jnp.arange(len(limits)) < len(limits) / 2)[:, None] * 2.0
        starts = jnp.stack([alike, lower, 0.1 * alike])
        return jax.vmap(lambda start: gap(position, start))(starts).min()

    return jax.vmap(least)(positions)
