"""A solver of one's own: gradient descent that halves its step where it does not help.

Beside this file lies own_solver.toml, a recipe that is `best` with this solver:

    based_on = "best"

    [planner.solver]
    name = "own_solver.py:Descent"
    parameters = { iterations = 60 }

and anything that takes a recipe takes it:

    s2c2a run circle --strategy pcc --recipe examples/extending/own_solver.toml

A solver is given a problem in two forms: `sum_of_norms(configurations)`, as the paper
has it, and `stacked(bends)`, for least squares. It begins at `problem.situation.last`
and hands back configurations; the planner keeps them within a step and the arm's
limits. It is traced by JAX: loops are `jax.lax`'s, and no branch depends on a value.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from s2c2a.kinematics import configurations_from_bends
from s2c2a.planning import Problem, Solver
from s2c2a.planning.terms import Configurations


@dataclass(frozen=True)
class Descent(Solver):
    """Gradient descent with a step size that grows after success and shrinks after failure.

    Attributes:
        iterations: in a control step.
        first: step, times the slope.
    """

    iterations: int = 40
    first: float = 0.1

    def solve(self, problem: Problem) -> Configurations:
        """See `Solver`."""
        cost = jax.value_and_grad(lambda bends: jnp.sum(problem.stacked(bends) ** 2))

        def iterate(_, now):
            bends, value, slope, step = now
            tried = problem.within_step(bends - step * slope)
            there = cost(tried)
            better = there[0] < value
            kept = jax.tree.map(
                lambda new, old: jnp.where(better, new, old),
                (tried, *there),
                (bends, value, slope),
            )
            return *kept, step * jnp.where(better, 1.5, 0.5)

        bends = problem.situation.last.bends
        begun = bends, *cost(bends), jnp.asarray(self.first)
        return configurations_from_bends(
            jax.lax.fori_loop(0, self.iterations, iterate, begun)[0]
        )
