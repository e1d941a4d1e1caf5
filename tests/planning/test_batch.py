"""A step over a batch gives the plans of the planner without guides."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from driven import MODEL, TWIN

from s2c2a.errors import TargetError
from s2c2a.estimation import Estimate
from s2c2a.planning import BEST, PAPER, Goal, Planner, Step

from marks import slow_after

TARGETS = [(0.1, 0.05, 0.55), (-0.2, 0.1, 0.5), (0.0, -0.15, 0.55), (0.2, 0.2, 0.45)]


def somewhere(count, seed=0):
    """Configurations a little bent, shape (count, 3, 3)."""
    random = np.random.default_rng(seed)
    bent = random.normal([0.1, 0.05, 1.0], [0.1, 0.1, 0.0], (count, 3, 3))
    return (bent / np.linalg.norm(bent, axis=-1, keepdims=True)).astype(np.float32)


@pytest.mark.parametrize("options", slow_after(1, [BEST, PAPER]))
@pytest.mark.parametrize(
    "obstacles",
    slow_after(1, [{"centers": [[0.1, 0.0, 0.55]], "thresholds": [0.05]}, {}]),
)
def test_each_plan_is_that_of_the_planner(options, obstacles):
    step = Step.of(TWIN, MODEL, options)
    planner = Planner(TWIN, MODEL, replace(options, guides=()))
    goal = Goal.of(3).with_obstacles(**obstacles) if obstacles else Goal.of(3)
    desired = [goal.with_position(target) for target in TARGETS]
    sensed = somewhere(len(TARGETS))
    started = jax.vmap(step.started)(sensed)
    many = jax.jit(jax.vmap(step.next_plan))(started, sensed, Goal.stacked(desired))
    for planned, one, goal in zip(many.configurations, sensed, desired, strict=True):
        plan = planner.plan(planner.start(Estimate(one)), Estimate(one), goal)
        np.testing.assert_allclose(planned, plan.configurations, atol=2e-4)


def test_goals_that_do_not_fit_are_not_stacked():
    with pytest.raises(TargetError, match="at least one"):
        Goal.stacked([])
    with pytest.raises(TargetError, match="different arms"):
        Goal.stacked([Goal.of(3), Goal.of(2)])
