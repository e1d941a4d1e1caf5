"""The fallback search leaves local minima and wrong slopes, and reports its outcome."""

from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
import pytest
from jaxtyping import Array

from s2c2a.arm import load_arm
from s2c2a.compilation import compilations
from s2c2a.errors import S2C2AError
from s2c2a.estimation import Estimate
from s2c2a.kinematics import bends_from_configurations
from s2c2a.models.forward_model import ForwardModel, PCCForwardModel
from s2c2a.planning import (
    BEST,
    NO_FALLBACK,
    PAPER,
    BatchPlanner,
    Goal,
    Outcome,
    Planner,
)
from s2c2a.planning.fallback import FallbackSearch

TWIN = load_arm("twin_arm")
MODEL = PCCForwardModel.of(TWIN)
STRAIGHT = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (3, 1))
ASIDE = Goal.of(3).with_position([0.2, 0.1, 0.5])
LOWER = Goal.of(3).with_position([0.0, 0.0, 0.55])
"""On the axis of the arm: a straight arm has no preferred side, and stays straight."""


class Uphill(ForwardModel):
    """Constant curvature whose engaged slopes point uphill."""

    truth: PCCForwardModel
    engaged: bool = eqx.field(static=True, default=False)

    def for_planning(self) -> "Uphill":
        return replace(self, engaged=True)

    def start(self, sensed):
        return self.truth.start(sensed)

    def observe(self, sensed, memory):
        return self.truth.observe(sensed, memory)

    def predict(self, configurations, memory, disturbances=None) -> Array:
        states = self.truth.predict(configurations, memory)
        return 2.0 * jax.lax.stop_gradient(states) - states if self.engaged else states


def run(planner, goal, steps):
    """Plans from rest, for an arm that follows its plan exactly."""
    plans = [planner.start(Estimate(STRAIGHT))]
    for _ in range(steps):
        plans.append(planner.plan(plans[-1], Estimate(plans[-1].configurations), goal))
    return plans


def gap(planner, plan, goal):
    return float(
        np.linalg.norm(planner.expectation(plan).states[-1, :3] - goal.positions[-1])
    )


def outcomes(plans):
    return [plan.outcome for plan in plans]


@pytest.fixture(scope="module")
def planner():
    return Planner(TWIN, MODEL, BEST)


@pytest.fixture(scope="module")
def misled():
    return Planner(TWIN, Uphill(MODEL), BEST)


def test_without_fallback_slopes_that_point_uphill_freeze_the_plan():
    planner = Planner(TWIN, Uphill(MODEL), replace(BEST, fallback=NO_FALLBACK))
    plans = run(planner, ASIDE, 10)
    np.testing.assert_allclose(plans[-1].configurations, STRAIGHT, atol=1e-3)
    assert set(outcomes(plans[1:])) == {Outcome.STALLED}


def test_true_slopes_take_over_within_the_same_step(misled):
    plans = run(misled, ASIDE, 60)
    assert plans[1].outcome is Outcome.RESTARTED
    assert gap(misled, plans[1], ASIDE) < gap(misled, plans[0], ASIDE) - 0.01
    assert gap(misled, plans[-1], ASIDE) < 0.01


def test_the_plan_moves_to_a_shape_behind_worse_ones_and_stays(planner):
    plans = run(planner, LOWER, 60)
    assert Outcome.FALLBACK in outcomes(plans)
    assert gap(planner, plans[-1], LOWER) < 0.01
    ends = [np.asarray(plan.configurations) for plan in plans[-10:]]
    assert np.abs(np.diff(ends, axis=0)).max() < 1e-3  # no oscillation


def test_steps_and_bends_stay_within_their_limits_on_the_way(planner):
    bends = np.array(
        [
            bends_from_configurations(plan.configurations)
            for plan in run(planner, LOWER, 40)
        ]
    )
    assert (
        np.rad2deg(np.linalg.norm(np.diff(bends, axis=0), axis=-1)).max() <= 4.0 + 0.01
    )
    assert np.rad2deg(np.linalg.norm(bends, axis=-1)).max() <= 47.0 + 0.01


def test_the_same_start_gives_the_same_plan(planner):
    first, again = (run(planner, LOWER, 15)[-1] for _ in range(2))
    np.testing.assert_array_equal(first.configurations, again.configurations)


def test_the_search_compiles_nothing_at_run_time(planner):
    before = compilations()
    run(planner, LOWER, 10)
    assert compilations() == before


def test_with_a_target_out_of_reach_the_arm_comes_to_rest(planner):
    plans = run(planner, Goal.of(3).with_position([0.5, 0.2, 0.7]), 150)
    ends = [np.asarray(plan.configurations) for plan in plans[-20:]]
    assert np.abs(np.diff(ends, axis=0)).max() < 1e-3


def test_a_batch_gives_the_plans_of_single_calls(misled):
    batch = BatchPlanner(TWIN, Uphill(MODEL), BEST, chunk=2, threads=1)
    starts = np.stack([STRAIGHT, STRAIGHT])
    many = batch.plan(batch.start(starts), starts, Goal.stacked([ASIDE, Goal.of(3)]))
    alone = misled.plan(misled.start(Estimate(STRAIGHT)), Estimate(STRAIGHT), ASIDE)
    np.testing.assert_allclose(many.configurations[0], alone.configurations, atol=2e-4)
    np.testing.assert_allclose(many.configurations[1], STRAIGHT, atol=1e-6)


def test_near_obstacles_the_plan_is_stuck():
    """The plan does not move to another shape, since its path could hit an obstacle."""
    goal = LOWER.with_obstacles([[0.4, 0.4, 0.1]], [0.02])
    planner = Planner(TWIN, MODEL, BEST)
    results = outcomes(run(planner, goal, 10))
    assert Outcome.FALLBACK not in results
    assert Outcome.STUCK in results


def test_the_planner_of_the_paper_has_no_fallback():
    assert PAPER.fallback == NO_FALLBACK


@pytest.mark.parametrize(
    "numbers", [{"iterations": 0}, {"least": -1.0}, {"starts": -1}]
)
def test_invalid_parameters_are_rejected(numbers):
    with pytest.raises(S2C2AError, match="was given"):
        FallbackSearch(**numbers)


def test_every_outcome_has_a_number_and_a_sentence():
    assert [int(outcome) for outcome in Outcome] == list(range(8))
    assert Outcome(4) is Outcome.STUCK
    assert all(outcome.sentence.endswith(".") for outcome in Outcome)
