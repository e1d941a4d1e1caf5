"""Reach: worked by hand for one module, laws for several, a long search, obstacles."""

from pathlib import Path

import jax
import numpy as np
import pytest
from driven import MODEL, TWIN

from s2c2a.errors import TargetError
from s2c2a.goals import Goal
from s2c2a.kinematics import states_from_bends
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import SIGNIFICANT, reach, reach_gaps
from s2c2a.spaces import AXIS, POSITION
from s2c2a.strategies import load_networks

POINTS = 24
"""Number of points in every call: another number would compile anew."""
STRAIGHT_UP = [[0, 0, 0.60], [0, 0, 0.65], [0, 0, 0.70]]


def gaps(arm, points, module=-1):
    """Gaps of a few points, padded with repetitions."""
    return reach_gaps(arm, np.resize(points, (POINTS, 3)), module)[: len(points)]


@pytest.fixture
def column(make_arm):
    """Three modules of 0.2 m that bend by at most 50 deg."""
    return make_arm(3, module={"bend_limit_deg": 50.0})


def test_above_a_straight_arm_the_gap_is_what_its_length_lacks():
    np.testing.assert_allclose(gaps(TWIN, STRAIGHT_UP), [0.0, 0.05, 0.10], atol=1e-5)


def test_below_the_end_of_one_straight_module_the_gap_is_the_way_down(make_arm):
    """Its end cannot move down the axis: a bend moves it sideways faster than down."""
    found = gaps(make_arm(1), [[0, 0, 0.19], [0, 0, 0.15]])
    np.testing.assert_allclose(found, [0.01, 0.05], atol=1e-5)


def test_a_module_stops_at_its_bend_limit(make_arm):
    """At 90 deg the end is a radius L / (pi / 2) up and aside; 60 deg stops before."""
    point = 0.2 / (np.pi / 2) * np.array([[1.0, 0.0, 1.0]])
    stopped = 0.2 / (np.pi / 3) * np.array([[0.5, 0.0, 0.75**0.5]])
    for limit, gap in ((90.0, 0.0), (60.0, np.linalg.norm(point - stopped))):
        arm = make_arm(1, module={"bend_limit_deg": limit})
        assert gaps(arm, point)[0] == pytest.approx(gap, abs=1e-4)


@pytest.mark.parametrize("height", [0.599, 0.565, 0.55])
def test_a_point_on_the_axis_below_the_straight_tip_is_reached_by_an_s(column, height):
    """A straight start would stay straight, since no direction is better."""
    points = [[0, 0, height], [1e-9, 0, height], [0, -1e-5, height]]
    assert gaps(column, points).max() < 1e-4


@pytest.mark.parametrize("modules", [2, 3])
def test_reachable_points_have_no_gap(make_arm, modules):
    """At the ends of 24 random shapes within its limits."""
    arm = make_arm(modules, module={"bend_limit_deg": 50.0})
    random = np.random.default_rng(modules)
    angles = random.uniform(-np.pi, np.pi, (POINTS, modules))
    sizes = np.deg2rad(50) * random.uniform(0, 1, (POINTS, modules))
    bends = sizes[..., None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    lengths = np.full(modules, 0.2, np.float32)
    ends = np.asarray(states_from_bends(bends.astype(np.float32), lengths))[:, -1, :3]
    assert gaps(arm, ends).max() < 1e-3 * arm.length


def test_modules_are_counted_from_the_base_or_back_from_the_tip(column):
    points = np.array([[0.05, 0.02, 0.38], [0.3, 0.0, 0.5]])
    np.testing.assert_array_equal(gaps(column, points, 1), gaps(column, points, -2))
    np.testing.assert_array_equal(gaps(column, points, 2), gaps(column, points))
    assert gaps(column, points, 1)[1] > 0.1 > 1e-3 > gaps(column, points)[1]


@pytest.mark.parametrize("module", [3, -4, 10**30])
def test_a_module_that_does_not_exist_is_rejected(module):
    told = f"module {module} does not exist; 'twin_arm' has 3"
    with pytest.raises(TargetError, match=told):
        gaps(TWIN, STRAIGHT_UP, module)


WEIGHTS = Path(__file__).parents[1] / "fixtures" / "best.safetensors"
EMPTY = Goal.of(3)


@pytest.fixture(scope="module")
def arcs():
    """The reach of arcs."""
    return reach.Reachability(TWIN, MODEL)


def drawn_states(count):
    """States of arcs with random bends within their limits."""
    bends = reach.spread_bends(np.full(3, np.deg2rad(45.0)), 64)[1 : count + 1]
    return np.asarray(states_from_bends(bends, np.full(3, 0.2, np.float32)))


@pytest.mark.slow
def test_the_search_ends_as_near_as_one_from_many_starts(arcs, monkeypatch):
    within = drawn_states(10)[:, -1, POSITION]
    random = np.random.default_rng(0)
    anywhere = random.uniform([-0.4, -0.4, 0.1], [0.4, 0.4, 0.6], (10, 3))
    positions = np.concatenate([within, anywhere])
    goals = Goal.stacked([EMPTY.with_position(position) for position in positions])
    short = arcs.nearest(goals)
    monkeypatch.setattr(reach, "STARTS", 64)
    monkeypatch.setattr(reach, "ITERATIONS", 60)
    nearest = reach._nearest
    # another function is another program
    monkeypatch.setattr(reach, "_nearest", lambda *parts: nearest(*parts))
    long = reach.Reachability(TWIN, MODEL).nearest(goals)
    assert short.within(TWIN.length)[:10].all()
    np.testing.assert_array_equal(short.within(TWIN.length), long.within(TWIN.length))
    excess = short.position_errors - long.position_errors
    assert excess.max() < SIGNIFICANT * TWIN.length


def test_an_axis_is_reached_with_its_position_and_the_opposite_one_is_not(arcs):
    state = drawn_states(5)[-1, -1]
    goal = EMPTY.with_position(state[POSITION])
    goals = [goal.with_axis(state[AXIS]), goal.with_axis(-state[AXIS])]
    reached = arcs.nearest(Goal.stacked(goals))
    np.testing.assert_array_equal(reached.within(TWIN.length), [True, False])
    assert reached.axis_errors[0] < np.deg2rad(3)
    assert reached.axis_errors[1] > np.deg2rad(30)


def test_an_obstacle_in_the_only_shape_puts_a_target_out_of_reach(arcs):
    straight = EMPTY.with_position([0, 0, TWIN.length])
    blocked = straight.with_obstacles([[0, 0, 0.3]], [0.08])
    reached = arcs.nearest(Goal.stacked([straight, blocked]))
    np.testing.assert_array_equal(reached.within(TWIN.length), [True, False])
    assert np.isinf(reached.clearances[0])
    assert -0.01 < reached.clearances[1] < 0.01
    assert reached.position_errors[1] > SIGNIFICANT * TWIN.length


def test_a_goal_without_a_target_is_refused(arcs):
    with pytest.raises(TargetError, match="always reached"):
        arcs.nearest(Goal.stacked([EMPTY]))


@pytest.mark.slow
def test_a_payload_lowers_a_bent_arm():
    model = load_networks(WEIGHTS, TWIN).c2s
    bends = np.tile(np.array([0.5, 0.0], np.float32), (3, 1))
    free, loaded = (
        reach.RestingArm.of(TWIN, model, payload) for payload in (0.0, 0.05)
    )
    sag = jax.jit(free.states)(bends) - jax.jit(loaded.states)(bends)
    assert sag[-1, 2] > 0.01


def test_arcs_have_no_lost_motion_that_encoders_would_miss(make_arm):
    module = {"bend_limit_deg": 50.0, "cable": {"travel": 0.05}}
    arm = make_arm(2, module=module, sensing="encoders")
    limits = reach.RestingArm.of(arm, PCCForwardModel.of(arm)).limits
    np.testing.assert_allclose(limits, np.deg2rad(50.0), rtol=1e-6)
