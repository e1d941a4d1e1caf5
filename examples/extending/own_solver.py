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
        first_step: initial step size, a factor of the gradient.
    """

    iterations: int = 40
    first_step: float = 0.1

    def solve(self, problem: Problem) -> Configurations:
        """See `Solver`."""
        cost_and_gradient = jax.value_and_grad(
            lambda bends: jnp.sum(problem.stacked(bends) ** 2)
        )

        def iterate(_, state):
            bends, cost, gradient, step = state
            trial = problem.within_step(bends - step * gradient)
            trial_cost, trial_gradient = cost_and_gradient(trial)
            better = trial_cost < cost
            kept = jax.tree.map(
                lambda new, old: jnp.where(better, new, old),
                (trial, trial_cost, trial_gradient),
                (bends, cost, gradient),
            )
            return *kept, step * jnp.where(better, 1.5, 0.5)

        bends = problem.situation.last.bends
        initial = bends, *cost_and_gradient(bends), jnp.asarray(self.first_step)
        return configurations_from_bends(
            jax.lax.fori_loop(0, self.iterations, iterate, initial)[0]
        )
