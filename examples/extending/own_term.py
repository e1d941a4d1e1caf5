"""A term of one's own: an elbow that is kept high, without a line changed in the package.

Beside this file lies own_term.toml, a recipe that is `best` and one term more:

    based_on = "best"

    [[planner.terms]]
    name = "own_term.py:ElbowHigh"
    parameters = { height = 0.42, weight = 50.0 }

and anything that takes a recipe takes it:

    s2c2a run circle --strategy pcc --recipe examples/extending/own_term.toml

A term is told a candidate for the next configuration (its configurations, bends,
predicted states, guarded points) and the situation (goal, last plan, limits and length
of the arm). It gives residuals in groups, shape (groups, axes), and the weight of each
group, or one for all. Adam adds up their norms, least squares their squares.
"""

from dataclasses import dataclass

import jax.numpy as jnp

from s2c2a.planning import Candidate, Residual, Situation, Term
from s2c2a.spaces import POSITION


@dataclass(frozen=True)
class ElbowHigh(Term):
    """The end of a module above a height.

    Attributes:
        height: along the straight arm [m].
        module: whose end.
        weight: mu, of what is missing in parts of the arm's length.
    """

    height: float = 0.3
    module: int = 1
    weight: float = 1.0

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """What is missing, one group of one axis."""
        height = candidate.states[self.module, POSITION][2]
        missing = jnp.maximum(self.height - height, 0.0) / situation.length
        return self.weight, missing.reshape(1, 1)
