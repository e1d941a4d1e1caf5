"""An arm moves slowly to a goal that rests, and the more slowly, the less it helps."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.goals import PREVIEW, Goal
from s2c2a.planning.motion import GoalMotion
from s2c2a.planning.outcomes import STILL
from s2c2a.planning.rest import CALM, GROWTH, SHRINKING, Rest, gaps_of, rests

ARM = load_arm("twin_arm")
LIMIT = ArmGeometry.of(ARM).step_limit
SLOW = STILL * LIMIT
WINDOW = 2 * PREVIEW
YES = jnp.asarray(True)
NO = jnp.asarray(False)


def step(rest, gaps, is_resting, arrived, share=1.0):
    """A step of which commands use a share."""
    return rest.after(share * rest.step, gaps, is_resting, arrived, ARM, 1)


@pytest.fixture(scope="module")
def after():
    return jax.jit(step)


def tip_gaps(values):
    """Gaps of the tip along x [m]."""
    return [jnp.zeros((3, 3)).at[-1, 0].set(value) for value in values]


def over(after, rest, gaps, share=1.0):
    for gap in gaps:
        rest = after(rest, gap, YES, YES, share)
    return rest


def test_an_arm_is_slow_once_its_plan_has_reached_a_goal_that_rests(after):
    [gap] = tip_gaps([0.1])
    rest = Rest.none(ARM)
    assert float(after(rest, gap, YES, NO).step) == pytest.approx(LIMIT)
    assert float(after(rest, gap, NO, YES).step) == pytest.approx(LIMIT)
    slow = after(rest, gap, YES, YES)
    assert float(slow.step) == pytest.approx(SLOW)
    # it stays so, while what it sees changes its plan
    assert float(after(slow, gap, YES, NO).step) == pytest.approx(SLOW)
    assert float(after(slow, gap, NO, NO).step) == pytest.approx(LIMIT)


def test_steps_that_help_grow_and_others_shrink_to_a_least_one(after):
    rest = over(after, Rest.none(ARM), tip_gaps([0.1] * WINDOW))
    first = float(rest.step)
    rest = over(after, rest, tip_gaps([0.05] * WINDOW))
    assert float(rest.step) == pytest.approx(GROWTH * first)
    rest = over(after, rest, tip_gaps([0.05] * WINDOW))
    assert float(rest.step) == pytest.approx(SHRINKING * GROWTH * first)
    rest = over(after, rest, tip_gaps([0.05] * (8 * WINDOW)))
    assert float(rest.step) == pytest.approx(SHRINKING**4 * SLOW)


def test_a_step_with_which_the_arm_swayed_is_not_taken_again(after):
    sway = 2.0 * CALM * ARM.length
    rest = over(after, Rest.none(ARM), tip_gaps([0.01] * WINDOW))
    swayed = over(after, rest, tip_gaps([sway, -sway] * (WINDOW // 2)))
    assert float(swayed.limit) == pytest.approx(SHRINKING * float(rest.step))
    helped = over(after, swayed, tip_gaps([0.001] * WINDOW))
    assert float(helped.step) == pytest.approx(float(swayed.limit))


def test_steps_that_were_not_used_stay(after):
    rest = over(after, Rest.none(ARM), tip_gaps([0.01] * WINDOW), share=0.1)
    # something else moves the arm
    moved = over(after, rest, tip_gaps([0.01, 0.2] * (WINDOW // 2)), share=0.1)
    assert float(moved.step) == float(rest.step)
    assert float(moved.limit) == float(rest.limit)


def test_what_is_not_seen_is_not_judged(after):
    nothing = jnp.full((3, 3), jnp.nan)
    rest = over(after, Rest.none(ARM), [nothing] * (2 * WINDOW))
    assert np.isinf(rest.error)
    rest = after(rest, *tip_gaps([0.1]), YES, YES)
    assert float(rest.error) == pytest.approx(0.1)


def test_gaps_are_of_the_picture_where_there_is_one():
    goal = Goal.of(3).with_position([0.1, 0.0, 0.5])
    ends = jnp.ones((3, 3))
    seen = np.full((3, 3), np.nan, np.float32)
    assert np.isnan(gaps_of(ends, seen, goal)).all()
    np.testing.assert_allclose(gaps_of(ends, None, goal)[-1], [0.9, 1.0, 0.5])
    seen[-1] = 0.2, 0.0, 0.5
    gaps = gaps_of(ends, seen, goal)
    np.testing.assert_allclose(gaps[-1], [0.1, 0.0, 0.0], atol=1e-7)
    np.testing.assert_array_equal(gaps[:-1], 0.0)


def test_goals_rest_that_neither_move_nor_will():
    goal = Goal.of(3).with_position([0.1, 0.0, 0.5])
    still = GoalMotion.of(3)
    assert rests(goal, still)
    assert not rests(Goal.of(3), still)
    assert not rests(goal, still._replace(step=still.step + 0.01))
    preview = np.tile(np.float32([0.1, 0.0, 0.5, 0.0, 0.0, 1.0]), (PREVIEW, 3, 1))
    preview[:, :-1] = np.nan
    assert rests(goal._replace(preview=preview), still)
    preview[-1, -1, 0] = 0.2
    assert not rests(goal._replace(preview=preview), still)
