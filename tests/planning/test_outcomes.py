"""Outcomes tell plans that reach their goal from those that move, stall or cannot."""

import jax
import numpy as np
import pytest
from driven import MODEL, TWIN

from s2c2a.arm import ArmGeometry
from s2c2a.kinematics import configurations_from_bends
from s2c2a.planning import BEST, PAPER, Goal, Outcome, plan_error
from s2c2a.planning.outcomes import SIGNIFICANT, judge
from s2c2a.planning.planner import Step

from marks import slow_after

STEP = Step.of(TWIN, MODEL, BEST)
LENGTHS = ArmGeometry.of(TWIN).lengths
LIMIT = np.deg2rad(47.0)
STRAIGHT = np.zeros((3, 2), np.float32)
FULL = np.tile(np.array([LIMIT, 0.0], np.float32), (3, 1))
"""All modules at their bend limit, towards x."""
HALF = 0.5 * FULL


@jax.jit
def judged_jit(last, planned, goal, droop=0.0):
    problem = STEP.problem(STEP.started(configurations_from_bends(last)), goal)
    candidate = problem.candidate_at(planned, problem.memory)
    lower = candidate.states.at[:, 2].add(-droop)
    situation = problem.situation._replace(goal=goal)
    return judge(candidate._replace(states=lower), situation, LENGTHS)


def judged(last, planned, position, droop=0.0):
    """Outcome of a plan, after a plan, towards a position of the tip."""
    goal = Goal.of(3).with_position(position)
    return Outcome(int(judged_jit(last, planned, goal, droop)))


def tip(bends):
    states = STEP.model.predict(configurations_from_bends(bends), ())
    return np.asarray(states[-1, :3], dtype=float)


def test_a_plan_at_its_goal_is_solved():
    assert judged(HALF, HALF, tip(HALF)) is Outcome.SOLVED
    near = tip(HALF) + np.array([0.0, 0.0, 0.9 * SIGNIFICANT * TWIN.length])
    assert judged(HALF, HALF, near) is Outcome.SOLVED


@pytest.mark.parametrize("distance", [0.007, 0.02, 0.1, 0.3])
def test_a_plan_that_stands_still_short_of_a_goal_within_reach_is_stalled(distance):
    """Away from x and down or up, both of which half bent modules can do."""
    for direction in ([0, 1, 0], [0, -1, 0], [0, 0.6, -0.8]):
        goal = tip(HALF) + distance * np.array(direction)
        assert judged(HALF, HALF, goal) is Outcome.STALLED


@pytest.mark.parametrize("distance", [0.007, 0.02, 0.1, 1.0])
def test_beyond_a_straight_arm_and_the_bend_limits_goals_are_out_of_reach(distance):
    above = tip(STRAIGHT) + np.array([0.0, 0.0, distance])
    assert judged(STRAIGHT, STRAIGHT, above) is Outcome.OUT_OF_REACH
    # at full bends, the end moves along its path when all modules bend further
    further = tip(FULL) - tip(0.99 * FULL)
    goal = tip(FULL) + distance * further / np.linalg.norm(further)
    assert judged(FULL, FULL, goal) is Outcome.OUT_OF_REACH


def test_the_forward_model_decides_how_far_the_plan_is_from_its_goal():
    """Ideal arcs reach this goal, the arm of this model hangs below it."""
    goal = tip(STRAIGHT)
    assert judged(STRAIGHT, STRAIGHT, goal) is Outcome.SOLVED
    assert judged(STRAIGHT, STRAIGHT, goal, droop=0.02) is Outcome.OUT_OF_REACH


@pytest.mark.parametrize("distance", [0.02, 0.2])
def test_a_plan_that_moves_along_the_edge_of_the_workspace_is_out_of_reach(distance):
    """Its goal moves as well, at a constant distance beyond a straight arm."""
    leaning = STRAIGHT + np.array([0.03, 0.0], np.float32) * [[1], [0], [0]]
    axis = np.array([np.sin(0.03), 0.0, np.cos(0.03)])
    goal = tip(leaning) + distance * axis
    assert judged(STRAIGHT, leaning, goal) is Outcome.OUT_OF_REACH


def test_a_plan_that_follows_a_goal_without_reaching_it_is_moving():
    towards = HALF + np.float32(0.5 * np.deg2rad(4.0) / np.sqrt(2))
    goal = tip(HALF + np.float32(0.3))
    assert judged(HALF, towards, goal) is Outcome.MOVING


def test_without_a_desired_position_a_plan_is_solved_and_has_no_error():
    goal = Goal.of(3)
    result = judged_jit(HALF, HALF, goal)
    assert Outcome(int(result)) is Outcome.SOLVED
    assert np.isnan(plan_error(np.zeros((3, 6)), goal))


def test_the_error_of_a_plan_is_that_of_its_worst_module_end():
    goal = Goal.of(3).with_position([0.0, 0.0, 0.57]).with_position([0, 0, 0.45], 1, 1)
    states = STEP.model.predict(configurations_from_bends(STRAIGHT), ())
    assert plan_error(states, goal) == pytest.approx(0.05, abs=1e-6)


@pytest.mark.parametrize("options", slow_after(1, [BEST, PAPER]))
def test_planners_judge_every_plan_anew(options):
    step = Step.of(TWIN, MODEL, options)
    next_plan = jax.jit(step.next_plan)
    above = Goal.of(3).with_position([0.0, 0.0, 0.7])
    straight = configurations_from_bends(STRAIGHT)
    plan = next_plan(step.started(straight), straight, above)
    assert plan.outcome is Outcome.OUT_OF_REACH
    near = Goal.of(3).with_position([0.0, 0.0, 0.6])
    assert next_plan(plan, straight, near).outcome is Outcome.SOLVED
