"""A solver of your own: gradient descent with a step that halves after a failure.

own_solver.toml is based on the recipe `best` and names this solver:

    based_on = "best"

    [planner.solver]
    name = "own_solver.py:Descent"
    parameters = { iterations = 60 }

Every command with a recipe accepts it:

    s2c2a run circle --strategy pcc --recipe examples/extending/own_solver.toml

A solver receives a problem in two forms: `sum_of_norms(configurations)`, the cost of
the paper, and `stacked(bends)`, residuals for least squares. It starts at
`problem.situation.last` and returns configurations; the planner limits them. JAX traces
it: write loops with `jax.lax`, and no branch that depends on a value.
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
