"""A cost term of your own: the elbow of the arm stays above a height.

own_term.toml is based on the recipe `best` and adds the term:

    based_on = "best"

    [[planner.terms]]
    name = "own_term.py:ElbowHigh"
    parameters = { height = 0.42, weight = 50.0 }

Every command with a recipe accepts it:

    s2c2a run circle --strategy pcc --recipe examples/extending/own_term.toml

A term receives a candidate for the next configuration (configurations, bends,
predicted states, guarded points) and the situation (goal, last plan, limits and length
of the arm). It returns residuals in groups, shape (groups, axes), with one weight for
all groups or one each. Adam minimizes the sum of their norms, least squares the sum of
their squares.
"""

from dataclasses import dataclass

import jax.numpy as jnp

from s2c2a.planning import Candidate, Residual, Situation, Term
from s2c2a.spaces import POSITION


@dataclass(frozen=True)
class ElbowHigh(Term):
    """Penalty where the end of a module is below a height.

    Attributes:
        height: along the straight arm [m].
        module: whose end.
        weight: mu of the missing height as a share of the arm's length.
    """

    height: float = 0.3
    module: int = 1
    weight: float = 1.0

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Missing height as a share of the arm's length, shape (1, 1)."""
        height = candidate.states[self.module, POSITION][2]
        missing = jnp.maximum(self.height - height, 0.0) / situation.length
        return self.weight, missing.reshape(1, 1)
