"""Adam against a second implementation, and limits that hold for every solver."""

from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from driven import MODEL, TWIN, bends_of, driven

from s2c2a.errors import S2C2AError
from s2c2a.kinematics import configurations_from_bends
from s2c2a.planning import BEST, PAPER, Adam, Goal, Horizon, Planner, Solver, Term
from s2c2a.planning.planner import Step

from marks import slow_after

STRAIGHT = jnp.tile(jnp.array([0.0, 0.0, 1.0]), (3, 1))


@pytest.mark.parametrize(
    "target", slow_after(1, [[0.22, 0.0, 0.54], [-0.1, 0.2, 0.5], [2.0, 0.0, 0.3]])
)
def test_adam_strictly_lowers_the_objective(target):
    step = Step.of(TWIN, MODEL, PAPER)
    problem = step.problem(step.started(STRAIGHT), Goal.of(3).with_position(target))
    solvers = [Adam(iterations=count) for count in (1, 10)]
    ends = [jax.jit(partial(solver.solve, problem))() for solver in solvers]
    values = [float(problem.sum_of_norms(end)) for end in (STRAIGHT, *ends)]
    assert values[0] > values[1] > values[2]


@dataclass(frozen=True)
class SquaredDistance(Term):
    """Squared distance from one vector for all modules."""

    x: float = 1.0

    def residual(self, candidate, situation):
        away = candidate.configurations - jnp.array([self.x, -2.0, 0.5])
        return 1.0, jnp.sum(away**2).reshape(1, 1)


def test_adam_is_adam_with_a_projection_after_every_iteration():
    """A second Adam (Kingma and Ba 2015, algorithm 1) in float64."""
    pull = np.array([[1.0, -2.0, 0.5]])
    first = np.array([[0.0, 0.6, 0.8], [0.6, 0.0, 0.8], [0.0, 0.0, 1.0]])
    place = first
    mean = square = 0.0
    for step in range(1, 11):
        gradient = 2 * (place - pull)
        mean = 0.9 * mean + 0.1 * gradient
        square = 0.999 * square + 0.001 * gradient**2
        place = place - 0.02 * (mean / (1 - 0.9**step)) / (
            np.sqrt(square / (1 - 0.999**step)) + 1e-8
        )
        place /= np.linalg.norm(place, axis=-1, keepdims=True)
    options = replace(PAPER, terms=(SquaredDistance(),))
    step = Step.of(TWIN, MODEL, options)
    start = step.started(jnp.asarray(first, dtype=jnp.float32))
    problem = step.problem(start, Goal.of(3))
    found = jax.jit(lambda: Adam().solve(problem))()
    np.testing.assert_allclose(found, place, atol=2e-6)


@dataclass(frozen=True)
class Unlimited(Solver):
    """Ignores the limits of the arm."""

    bend: float = 3.0

    def solve(self, problem):
        last = problem.situation.last.bends
        return configurations_from_bends(jnp.full_like(last, self.bend))


def test_plans_of_every_solver_stay_within_the_limits_of_the_arm():
    planner = Planner(TWIN, MODEL, replace(BEST, solver=Unlimited(), guides=()))
    bends = bends_of(driven(planner, [Goal.of(3)] * 20)[1])
    steps = np.rad2deg(np.linalg.norm(np.diff(bends, axis=0), axis=-1))
    assert steps.max() <= 4.0 + 0.01
    assert 46.0 < np.rad2deg(np.linalg.norm(bends, axis=-1)).max() <= 47.0 + 0.01


@pytest.mark.parametrize("number", [np.nan, np.inf, -1.0])
@pytest.mark.parametrize(
    "part",
    [*BEST.terms, *PAPER.terms, *BEST.guides, Adam(), Horizon(), Unlimited()],
)
def test_invalid_parameters_of_components_are_rejected(part, number):
    for name in vars(part).keys() - {"name"}:
        with pytest.raises(S2C2AError, match=f"{name} = .* was given"):
            replace(part, **{name: number})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Adam(learning_rate=0.0), "learning_rate = 0.0 was given"),
        (lambda: Adam(iterations=0), "iterations = 0 was given .*; choose 1 to 10000"),
        (lambda: Adam(iterations=10_001), "choose 1 to 10000"),
        (lambda: replace(BEST.terms[0], unit=0.0), "unit = 0.0 was given"),
        (lambda: replace(BEST, terms=()), "at least one"),
    ],
)
def test_invalid_options_are_rejected(make, message):
    with pytest.raises(S2C2AError, match=message):
        make()
