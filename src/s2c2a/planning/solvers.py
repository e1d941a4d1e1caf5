"""Solvers: from a problem to configurations. The planner keeps what they find within the arm's limits."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float

from s2c2a.kinematics import bends_from_configurations, configurations_from_bends, limit_lengths
from s2c2a.parts import Kind, Part
from s2c2a.planning.least_squares import solve_least_squares
from s2c2a.planning.situation import Bends, Candidate, Configurations, Situation, norm
from s2c2a.planning.terms import Residual, Term


class Problem(NamedTuple):
    """What is to be made small in a control step, in both forms that solvers ask for.

    Attributes:
        situation: what is fixed; `situation.last` is where to begin.
        terms: what candidates are judged by.
        look: (configurations, the same as bends) -> a candidate with what is predicted for it.
    """

    situation: Situation
    terms: tuple[Term, ...]
    look: Callable[[Configurations, Bends], Candidate]

    def sum_of_norms(self, configurations: Configurations) -> Float[Array, ""]:
        """The sum over all groups of mu |r| (Chen et al. 2025, eq. (7))."""
        judged = self._judged(self.look(configurations, bends_from_configurations(configurations)))
        return sum((jnp.sum(mu * norm(rows)) for mu, rows in judged), jnp.zeros(()))

    def stacked(self, bends: Bends) -> Float[Array, " residuals"]:
        """All r times the root of mu, one behind the other: least squares of them are the least sum of mu |r|^2."""
        judged = self._judged(self.look(configurations_from_bends(bends), bends))
        return jnp.concatenate([(jnp.sqrt(jnp.asarray(mu))[..., None] * rows).reshape(-1) for mu, rows in judged])

    def within_limits(self, wanted: Configurations) -> Configurations:
        """Bends within their limits, and no further than a step from the last ones.

        The angle between two configurations is never more than the distance of their bends. Vectors that are not of
        unit length have no bend limits.
        """
        situation = self.situation
        if not situation.on_sphere:
            last = situation.last.configurations
            return last + limit_lengths(wanted - last, situation.longest_step)
        allowed = limit_lengths(bends_from_configurations(wanted), situation.bend_limits)
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

    Where configurations are of unit length, each module's vector returns to it after every iteration.

    Attributes:
        learning_rate: of Adam.
        iterations: in a control step.
    """

    learning_rate: float = 0.02
    iterations: int = 10

    def solve(self, problem: Problem) -> Configurations:
        """See `Solver`."""
        optimiser, gradient = optax.adam(self.learning_rate), jax.grad(problem.sum_of_norms)
        on_sphere, start = problem.situation.on_sphere, problem.situation.last.configurations

        def iterate(_, carry):
            configurations, state = carry
            updates, state = optimiser.update(gradient(configurations), state)
            moved = configurations + updates
            return moved / norm(moved)[:, None] if on_sphere else moved, state

        return jax.lax.fori_loop(0, self.iterations, iterate, (start, optimiser.init(start)))[0]


@dataclass(frozen=True)
class LeastSquares(Solver):
    """Damped least squares on bends (Levenberg and Marquardt); every iterate stays within the step.

    Attributes:
        iterations: in a control step.
    """

    iterations: int = 20

    def solve(self, problem: Problem) -> Configurations:
        """See `Solver`."""
        start = problem.situation.last.bends

        flat = solve_least_squares(
            lambda flat: problem.stacked(flat.reshape(start.shape)),
            start.reshape(-1),
            lambda flat: problem.within_step(flat.reshape(start.shape)).reshape(-1),
            self.iterations,
        )
        return configurations_from_bends(flat.reshape(start.shape))


SOLVERS = Kind.of("solver", Solver, Adam, LeastSquares)
