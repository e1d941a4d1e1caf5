"""An arm moves slowly to a goal that rests, and the more slowly, the less it helps."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from driven import MODEL, TWIN

from s2c2a.arm import ArmGeometry
from s2c2a.goals import PREVIEW, Goal
from s2c2a.kinematics import configurations_from_bends
from s2c2a.models.session import DayChange, SessionC2S
from s2c2a.planning import BEST, Outcome
from s2c2a.planning.motion import GoalMotion
from s2c2a.planning.outcomes import STILL
from s2c2a.planning.planner import Step
from s2c2a.planning.rest import FALL, FALLEN, THERE, Rest, gaps_of, rests

LIMIT = ArmGeometry.of(TWIN).step_limit
SLOW = STILL * LIMIT
WINDOW = 2 * PREVIEW
NEAR = jnp.asarray(0.0)
FAR = jnp.asarray(1.0)
STEP = Step.of(TWIN, MODEL, BEST)
BENT = jnp.full((3, 2), 0.1)
STRAIGHT = jnp.tile(jnp.array([0.0, 0.0, 1.0]), (3, 1))


TIP = Goal.of(3).with_position([0.0, 0.0, 0.5])


def step(rest, gaps, ahead, goal=TIP, is_seen=True):
    return rest.after(ahead, gaps, is_seen, BENT, goal, TWIN, 1)


@pytest.fixture(scope="module")
def after():
    return jax.jit(step)


def tip_gaps(values, from_arcs=0.0):
    """Gaps of the tip from its goal, along x, and from arcs [m]."""
    none = jnp.zeros((3, 3, 3)).at[2, -1, 0].set(from_arcs)
    return [none.at[0, -1, 0].set(value) for value in values]


def over(after, rest, gaps):
    for gap in gaps:
        rest = after(rest, gap, NEAR)
    return rest


def windows(after, *gaps):
    """After windows with the same gap each [m]."""
    rest = Rest.none(TWIN)
    for gap in gaps:
        rest = over(after, rest, tip_gaps([gap] * WINDOW))
    return rest


def test_an_arm_is_slow_once_its_plan_has_reached_a_goal_that_rests(after):
    [gap] = tip_gaps([0.1])
    rest = Rest.none(TWIN)
    assert float(after(rest, gap, FAR).step) == pytest.approx(LIMIT)
    slow = after(rest, gap, NEAR)
    assert float(slow.step) == pytest.approx(SLOW)
    # it stays so, while what it sees changes its plan
    assert float(after(slow, gap, FAR).step) == pytest.approx(SLOW)


@pytest.mark.parametrize("distance", [0.1, 2.0], ids=["near", "out of reach"])
def test_an_arm_follows_a_new_goal_from_the_first_step(distance):
    next_plan = jax.jit(STEP.next_plan)
    planned = STEP.started(STRAIGHT)
    goal = Goal.of(3).with_position([distance, 0.0, 0.5])
    for _ in range(WINDOW):
        planned = next_plan(planned, STRAIGHT, goal)
    slow = float(planned.rest.step)
    assert slow < 0.2 * LIMIT
    moved = next_plan(planned, STRAIGHT, goal.with_position([distance, 0.1, 0.5]))
    assert float(abs(moved.bends - planned.bends).max()) > 1.1 * slow


def step_for(gap, trust=1.0):
    return pytest.approx(trust * gap / (TWIN.length * WINDOW), rel=1e-4)


@pytest.mark.parametrize(
    ("later", "trust"),
    [
        ([], 1.0),
        ([1.0, 0.95], 1.0),  # backlash takes up commands
        ([-1.0], 0.5),  # beyond its goal
        ([-1.0, 1.0, -1.0], 0.5**3),
        ([-1.0, -0.8], 1.0),  # helps
    ],
)
def test_steps_are_worth_the_gap_and_less_where_it_turns(later, trust, after):
    near = 2.0 * THERE * TWIN.length
    moved = windows(after, near, *(near * gap for gap in later))
    assert float(moved.step) == step_for(near * abs([1.0, *later][-1]), trust)


def test_steps_are_at_most_as_fast_as_before(after):
    assert float(windows(after, 0.5).step) == pytest.approx(SLOW)


@pytest.mark.parametrize("module", [0, 2])
def test_steps_are_worth_the_gap_at_the_farthest_end_with_a_goal(module):
    next_plan = jax.jit(STEP.next_plan)
    lengths = np.cumsum(ArmGeometry.of(TWIN).lengths)
    planned = STEP.started(STRAIGHT)
    goal = Goal.of(3).with_position([0.01, 0.0, lengths[module]], module=module)
    seen = goal.positions + np.float32([0.0, 0.004, 0.0])
    for _ in range(WINDOW):
        planned = next_plan(planned, STRAIGHT, goal, seen=seen)
    expected = 0.004 / (lengths[module] * WINDOW)
    assert float(planned.rest.step) == pytest.approx(expected, rel=1e-4)


def test_an_arm_that_is_there_rests_until_its_gap_is_twice_as_large(after):
    there = THERE * TWIN.length
    resting = float(windows(after, 0.9 * there).step)
    assert 0.0 < resting < 1e-3 * SLOW
    assert float(windows(after, 0.9 * there, 1.9 * there).step) == pytest.approx(
        resting
    )
    assert float(windows(after, 0.9 * there, 2.1 * there).step) == step_for(2.1 * there)


def test_an_arm_with_a_desired_direction_does_not_rest(after):
    rest, turned = Rest.none(TWIN), TIP.with_axis([0.6, 0.0, 0.8])
    for gap in tip_gaps([0.0] * WINDOW):
        rest = after(rest, gap, NEAR, turned)
    assert float(rest.step) == pytest.approx(STILL**2 * SLOW)


def test_an_arm_that_was_pushed_is_trusted_anew(after):
    pushed = windows(after, 0.01, 0.01, 0.01, 0.03)
    assert float(pushed.trust) == 1.0
    assert float(pushed.smallest) == pytest.approx(0.03)


def test_gaps_that_come_back_are_trusted_less_until_the_arm_was_there(after):
    sway = [0.03, 0.01] * 4
    trusts = [float(windows(after, *sway[: 2 * n + 1]).trust) for n in range(4)]
    better = (1.0 + FALL) / 2.0  # in time, too
    assert trusts == pytest.approx([1.0, 1.0, better, better**2])
    calm = windows(after, *sway, *[0.01] * 16, 0.03)
    assert float(calm.trust) == 1.0
    there = 0.9 * THERE * TWIN.length
    assert float(windows(after, *sway, there, 0.03).trust) == 1.0


def test_an_arm_that_sees_nothing_in_a_window_goes_by_what_is_predicted(after):
    unseen = jax.jit(partial(step, is_seen=False))
    [gap] = tip_gaps([0.008])
    rest = over(unseen, windows(after, 0.01), [gap] * WINDOW)
    assert float(rest.step) == step_for(0.008)
    # one picture outweighs all predictions
    rest = over(after, windows(after, 0.01), tip_gaps([0.009]))
    rest = over(unseen, rest, [gap] * (WINDOW - 1))
    assert float(rest.step) == step_for(0.009)


def test_plans_count_on_what_bends_do_not_explain():
    """The tip is seen beside where the model has it, and the goal is reached as seen."""
    next_plan = jax.jit(STEP.next_plan)
    goal = Goal.of(3).with_position([0.1, 0.0, 0.55])
    beside = np.float32([0.0, 0.004, 0.002])
    plan = STEP.started(STRAIGHT)
    for _ in range(12 * WINDOW):
        ends = STEP.model.predict(plan.configurations, plan.memory)[:, :3]
        plan = next_plan(
            plan, plan.configurations, goal, seen=np.asarray(ends) + beside
        )
    seen = STEP.model.predict(plan.configurations, plan.memory)[-1, :3] + beside
    assert np.linalg.norm(seen - goal.positions[-1]) < 1.1 * THERE * TWIN.length
    np.testing.assert_allclose(plan.expectation.states[-1, :3], seen, atol=5e-4)
    # a goal that moves is followed by the model alone
    moved = next_plan(plan, STRAIGHT, goal.with_position([0.1, 0.05, 0.55]))
    np.testing.assert_array_equal(moved.rest.missed, 0.0)


def test_late_pictures_of_an_arm_on_its_way_teach_nothing():
    """They are of where it was, which is no error of the model."""
    next_plan = jax.jit(STEP.next_plan)
    goal = Goal.of(3).with_position([0.1, 0.0, 0.55])
    plan = STEP.started(STRAIGHT)
    pictures = []
    for _ in range(2 * WINDOW):
        ends = STEP.model.predict(plan.configurations, plan.memory)[:, :3]
        pictures.append(np.asarray(ends))
        late = pictures[max(0, len(pictures) - 4)]
        plan = next_plan(plan, plan.configurations, goal, seen=late)
        assert float(abs(plan.rest.missed).max()) < 1e-4
    assert np.linalg.norm(ends[-1] - goal.positions[-1]) < THERE * TWIN.length


def test_a_plan_that_finds_no_rest_is_slow_after_two_horizons(after):
    rest = Rest.none(TWIN)
    for gap in tip_gaps([0.1, 0.2] * (WINDOW // 2)):
        rest = after(rest, gap, FAR)
        assert float(rest.step) == pytest.approx(LIMIT)
    assert float(after(rest, *tip_gaps([0.1]), FAR).step) < 2.0 * SLOW


FAR_AWAY = 1.1 * FALLEN * TWIN.length


def test_an_arm_that_lies_far_from_its_goal_for_two_windows_is_overloaded(after):
    lying = tip_gaps([FAR_AWAY] * WINDOW, from_arcs=FAR_AWAY)
    rest = over(after, Rest.none(TWIN), lying)
    assert not rest.is_overloaded
    rest = over(after, rest, lying)
    assert rest.is_overloaded
    # until the goal changes, or the arm is there again; its steps do not shrink
    rest = over(after, rest, tip_gaps([0.1] * (3 * WINDOW)))
    assert rest.is_overloaded
    assert float(rest.step) == pytest.approx(SLOW)
    assert not over(after, rest, tip_gaps([0.0] * WINDOW)).is_overloaded


@pytest.mark.parametrize(
    "gaps",
    [
        tip_gaps([FAR_AWAY] * (4 * WINDOW)),  # out of reach, or on its way
        tip_gaps([0.0] * (4 * WINDOW), FAR_AWAY),  # a load that is carried
        # falls once
        tip_gaps(([FAR_AWAY] * WINDOW + [0.8 * FAR_AWAY] * WINDOW) * 2, FAR_AWAY),
    ],
)
def test_others_are_not(after, gaps):
    assert not over(after, Rest.none(TWIN), gaps).is_overloaded


def test_an_overloaded_arm_stops_where_it_is_calm_on_its_way_to_rest(after):
    rest = over(after, Rest.none(TWIN), tip_gaps([0.01] * WINDOW))
    lying = tip_gaps([FAR_AWAY] * WINDOW, from_arcs=FAR_AWAY)
    rest = over(after, over(after, rest, lying), lying)
    np.testing.assert_array_equal(rest.calm, 0.0)
    swaying = tip_gaps([0.2, -0.2] * (WINDOW // 2))
    rest = over(after, rest, swaying)
    np.testing.assert_array_equal(rest.calm, 0.0)
    rest = over(after, rest, tip_gaps([0.2] * WINDOW))
    np.testing.assert_array_equal(rest.calm, BENT)
    assert rest.is_overloaded


def test_an_overloaded_arm_goes_slowly_to_where_it_is_calm_until_its_goal_changes():
    next_plan = jax.jit(STEP.next_plan)
    goal = Goal.of(3).with_position([0.2, 0.0, 0.5])
    plan = next_plan(STEP.started(STRAIGHT), STRAIGHT, goal)
    fallen, is_slow = jnp.asarray(2), jnp.asarray(True)
    rest = plan.rest._replace(fallen=fallen, is_slow=is_slow, step=jnp.asarray(SLOW))
    plan = plan._replace(rest=rest._replace(calm=BENT))
    for _ in range(60):
        last, plan = plan, next_plan(plan, STRAIGHT, goal)
        assert plan.outcome is Outcome.OVERLOADED
        assert float(abs(plan.bends - last.bends).max()) < 1.01 * SLOW
    np.testing.assert_allclose(plan.bends, BENT, atol=np.deg2rad(0.5))
    other = goal.with_position([0.1, 0.0, 0.5])
    assert next_plan(plan, STRAIGHT, other).outcome is Outcome.MOVING


def test_gaps_are_of_the_picture_where_there_is_one():
    goal = Goal.of(3).with_position([0.1, 0.0, 0.5])
    ends = jnp.ones((3, 3))
    arcs = jnp.zeros((3, 3))
    seen = np.full((3, 3), np.nan, np.float32)
    predicted, _ = gaps_of(STEP.model, ends, None, goal, arcs)
    unseen, is_seen = gaps_of(STEP.model, ends, seen, goal, arcs)
    assert not is_seen
    np.testing.assert_array_equal(unseen, predicted)
    np.testing.assert_allclose(predicted[:, -1], [[0.9, 1.0, 0.5], [0] * 3, [1] * 3])
    seen[-1] = 0.2, 0.0, 0.5
    gaps, is_seen = gaps_of(STEP.model, ends, seen, goal, arcs)
    assert is_seen
    expected = [0.1, 0.0, 0.0], seen[-1] - 1.0, seen[-1]
    np.testing.assert_allclose(gaps[:, -1], expected, atol=1e-7)
    np.testing.assert_array_equal(gaps[:, :-1], 0.0)


def test_arcs_are_compared_in_the_frame_of_the_base():
    """On another day, the tracking has another frame."""
    turn = jnp.array([0.0, 0.0, np.pi / 2])
    change = replace(DayChange.none(3), rotation=turn, translation=jnp.full(3, 0.25))
    model = SessionC2S.of(MODEL, change)
    states = model.predict(configurations_from_bends(BENT), ())
    arcs = MODEL.predict(configurations_from_bends(BENT), ())
    goal = Goal.of(3).with_position([0.1, 0.0, 0.5])
    gaps, _ = gaps_of(model, states[:, :3], None, goal, arcs[:, :3])
    np.testing.assert_allclose(gaps[2], 0.0, atol=1e-6)


def test_goals_rest_that_neither_change_nor_will():
    goal = Goal.of(3).with_position([0.1, 0.0, 0.5])

    def after(before):
        motion, _ = GoalMotion.of(3).after(before, jnp.zeros((3, 6)), STEP.approach)
        return motion

    assert rests(goal, after(goal))
    assert not rests(Goal.of(3), after(Goal.of(3)))
    assert not rests(goal, after(goal.with_position([0.11, 0.0, 0.5])))
    # another end or axis is desired
    assert not rests(goal.with_axis([0.0, 0.0, 1.0]), after(goal))
    # an obstacle may grow
    beside = goal.with_obstacles([[0.2, 0.0, 0.5]], [0.05])
    assert not rests(beside, after(beside))
    preview = np.tile(np.float32([0.1, 0.0, 0.5, 0.0, 0.0, 1.0]), (PREVIEW, 3, 1))
    preview[:, :-1] = np.nan
    assert rests(goal._replace(preview=preview), after(goal))
    preview[-1, -1, 0] = 0.2
    assert not rests(goal._replace(preview=preview), after(goal))
