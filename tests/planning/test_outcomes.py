"""Outcomes tell plans that reach their goal from those that move, stall or cannot."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.kinematics import configurations_from_bends
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import BEST, PAPER, Goal, Outcome, Plan, plan_error
from s2c2a.planning.outcomes import REACHED, judge
from s2c2a.planning.planner import Step

TWIN = load_arm("twin_arm")
STEP = Step.of(TWIN, PCCForwardModel.of(TWIN), BEST)
LIMIT = np.deg2rad(47.0)
FULL = np.tile(np.array([LIMIT, 0.0], np.float32), (3, 1))
"""All modules at their bend limit, towards x."""
HALF = 0.5 * FULL
LEANING = HALF + np.float32(0.05)


@jax.jit
def judged_jit(last, planned, goal, outcome):
    plan = Plan(configurations_from_bends(last), (), None)
    return judge(outcome, STEP.problem(plan, goal).with_goal(goal), planned)


def judged(last, planned, position, outcome=Outcome.SOLVED):
    """Outcome and error of a plan, after a plan, towards a position of the tip."""
    goal = Goal.of(3).with_position(position)
    result, error = judged_jit(last, planned, goal, jnp.asarray(int(outcome)))
    return Outcome(int(result)), float(error)


def tip(bends):
    states = STEP.model.predict(configurations_from_bends(bends), ())
    return np.asarray(states[-1, :3], dtype=float)


def test_a_plan_at_its_goal_is_solved():
    assert judged(HALF, HALF, tip(HALF))[0] is Outcome.SOLVED
    near = tip(HALF) + np.array([0.0, 0.0, 0.9 * REACHED * TWIN.length])
    assert judged(HALF, HALF, near)[0] is Outcome.SOLVED


@pytest.mark.parametrize("distance", [0.002, 0.02, 0.1])
def test_a_plan_that_stands_still_short_of_a_goal_within_reach_is_stalled(distance):
    """Away from x and down or up, both of which half bent modules can do."""
    for direction in ([0, 1, 0], [0, -1, 0], [0, 0.6, -0.8]):
        goal = tip(HALF) + distance * np.array(direction)
        outcome, error = judged(HALF, HALF, goal)
        assert outcome is Outcome.STALLED
        assert error == pytest.approx(distance, abs=1e-6)


@pytest.mark.parametrize("distance", [0.002, 0.02, 0.1, 1.0])
def test_beyond_a_straight_arm_and_the_bend_limits_goals_are_out_of_reach(distance):
    straight = np.zeros_like(FULL)
    above = tip(straight) + np.array([0.0, 0.0, distance])
    assert judged(straight, straight, above)[0] is Outcome.OUT_OF_REACH
    # at full bends, the end moves along its path when all modules bend further
    further = tip(FULL) - tip(0.99 * FULL)
    goal = tip(FULL) + distance * further / np.linalg.norm(further)
    assert judged(FULL, FULL, goal)[0] is Outcome.OUT_OF_REACH


def test_a_plan_that_follows_a_goal_without_reaching_it_is_moving():
    towards = HALF + np.float32(0.5 * np.deg2rad(4.0) / np.sqrt(2))
    goal = tip(HALF + np.float32(0.3))
    assert judged(HALF, towards, goal)[0] is Outcome.MOVING


def test_what_the_fallback_search_did_stays_unless_a_kept_plan_cannot_get_nearer():
    goal = tip(LEANING)
    for outcome in (
        Outcome.KEPT,
        Outcome.RESTARTED,
        Outcome.FALLBACK,
        Outcome.STUCK,
    ):
        assert judged(HALF, HALF, goal, outcome)[0] is outcome
    straight = np.zeros_like(FULL)
    above = tip(straight) + np.array([0.0, 0.0, 0.1])
    kept = judged(straight, straight, above, Outcome.KEPT)[0]
    assert kept is Outcome.OUT_OF_REACH


def test_without_a_desired_position_a_plan_is_solved_and_has_no_error():
    goal = Goal.of(3)
    result, error = judged_jit(HALF, HALF, goal, jnp.asarray(0))
    assert Outcome(int(result)) is Outcome.SOLVED
    assert np.isnan(error)


def test_the_error_of_a_plan_is_that_of_its_worst_module_end():
    goal = Goal.of(3).with_position([0.0, 0.0, 0.57]).with_position([0, 0, 0.45], 1, 1)
    states = STEP.model.predict(configurations_from_bends(np.zeros((3, 2))), ())
    assert float(plan_error(states, goal)) == pytest.approx(0.05, abs=1e-6)


def test_the_planner_of_the_paper_judges_its_plans_as_well():
    step = Step.of(TWIN, PCCForwardModel.of(TWIN), PAPER)
    goal = Goal.of(3).with_position([0.0, 0.0, 0.7])
    straight = configurations_from_bends(np.zeros((3, 2), np.float32))
    plan = jax.jit(step.next_plan)(step.started(straight), straight, goal)
    assert plan.outcome is Outcome.OUT_OF_REACH
    assert float(plan.error) == pytest.approx(0.1, abs=1e-4)
