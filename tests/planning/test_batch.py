"""A step over a batch gives the plans of the planner without guides."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import TargetError
from s2c2a.estimation import Estimate
from s2c2a.kinematics import states_from_configurations
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import BEST, PAPER, Goal, Planner, Step

from marks import slow_after

TWIN = load_arm("twin_arm")
PARTS = TWIN, PCCForwardModel.of(TWIN)
STRAIGHT = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (1, 3, 1))
TARGETS = np.array(
    [
        [0.1, 0.05, 0.55],
        [-0.2, 0.1, 0.5],
        [0.0, -0.15, 0.55],
        [0.05, 0.2, 0.5],
        [0.2, 0.2, 0.45],
    ]
)
BOTH = pytest.mark.parametrize("options", slow_after(1, [BEST, PAPER]))


def somewhere(count, seed=0):
    """Configurations a little bent, shape (count, 3, 3)."""
    bent = np.random.default_rng(seed).normal(
        [0.1, 0.05, 1.0], [0.1, 0.1, 0.0], (count, 3, 3)
    )
    return (bent / np.linalg.norm(bent, axis=-1, keepdims=True)).astype(np.float32)


def tips(configurations):
    return np.asarray(states_from_configurations(configurations, PARTS[1].lengths))[
        ..., -1, :3
    ]


def goals(**obstacles):
    desired = [Goal.of(3).with_position(target) for target in TARGETS]
    return [goal.with_obstacles(**obstacles) if obstacles else goal for goal in desired]


@BOTH
@pytest.mark.parametrize(
    "obstacles",
    slow_after(1, [{"centers": [[0.1, 0.0, 0.55]], "thresholds": [0.05]}, {}]),
)
def test_each_plan_is_that_of_the_planner(options, obstacles):
    step = Step.of(*PARTS, options)
    planner = Planner(*PARTS, replace(options, guides=()))
    desired = goals(**obstacles)
    sensed = somewhere(5)
    started = jax.vmap(step.started)(sensed)
    many = jax.jit(jax.vmap(step.next_plan))(started, sensed, Goal.stacked(desired))
    each = [
        planner.plan(planner.start(Estimate(one)), Estimate(one), goal).configurations
        for one, goal in zip(sensed, desired, strict=True)
    ]
    np.testing.assert_allclose(many.configurations, each, atol=2e-4)


def test_goals_that_do_not_fit_are_not_stacked():
    with pytest.raises(TargetError, match="at least one"):
        Goal.stacked([])
    with pytest.raises(TargetError, match="different arms"):
        Goal.stacked([Goal.of(3), Goal.of(2)])
