"""Ways around obstacles, and plans that are led along them."""

import threading
from dataclasses import replace

import jax
import numpy as np
import pytest
from driven import MODEL, TWIN, bends_of, driven
from scipy.spatial.transform import Rotation

from s2c2a.arm.geometry import center_line
from s2c2a.goals import Goal, previewed
from s2c2a.kinematics import states_from_bends
from s2c2a.planning import BEST, Detour, Outcome, Planner
from s2c2a.planning.ways import Roadmap, resampled

from marks import slow_after

LENGTHS = np.full(3, 0.2, np.float32)
STRAIGHT = np.zeros((3, 2), np.float32)
TARGET = (0.30, 0.0, 0.49)
SPHERES = [(0.16, 0.02, 0.55, 0.06), (0.21, -0.03, 0.52, 0.04)]
LEAST, MARGIN = 0.006, 0.024


@pytest.fixture(scope="module")
def roadmap():
    return Roadmap(TWIN, MODEL, "arm")


states_of = jax.jit(jax.vmap(lambda bends: states_from_bends(bends, LENGTHS)))


def goal_with(*spheres, target=TARGET):
    """A goal with a target of the tip, and obstacles (x, y, z, threshold)."""
    table = np.reshape(spheres, (-1, 4))
    goal = Goal.of(3).with_obstacles(table[:, :3], table[:, 3])
    return goal.with_position(target)


def clearance(way, spheres):
    """Smallest distance of the center line from the spheres on the way [m]."""
    bends = resampled(way.bends, 400).astype(np.float32)
    lines = center_line(np.asarray(states_of(bends)), LENGTHS, 15)
    table = np.reshape(spheres, (-1, 4))
    distances = np.linalg.norm(lines[..., None, :] - table[:, :3], axis=-1)
    return (distances - table[:, 3]).min()


@pytest.mark.slow
@pytest.mark.parametrize("count", slow_after(1, [2, 1]))
@pytest.mark.parametrize("turn_deg", slow_after(1, [160.0, 0.0]))
def test_a_way_leads_the_whole_arm_past_spheres(roadmap, count, turn_deg):
    around = Rotation.from_euler("z", turn_deg, degrees=True).as_matrix()
    spheres = [(*around @ sphere[:3], sphere[3]) for sphere in SPHERES[:count]]
    target = around @ TARGET
    way = roadmap.find(STRAIGHT, goal_with(*spheres, target=target), LEAST, MARGIN)
    assert np.linalg.norm(way.tips[-1] - target) < 2e-3
    assert clearance(way, spheres) > 0.0
    assert way.length < 1.4 * np.linalg.norm(target - np.array([0.0, 0.0, 0.6]))
    assert not way.is_straight
    np.testing.assert_allclose(way.bends[0], STRAIGHT, atol=1e-6)


@pytest.mark.slow
def test_a_free_way_is_straight_in_bends(roadmap):
    way = roadmap.find(STRAIGHT, goal_with((-0.3, 0.0, 0.5, 0.05)), LEAST, MARGIN)
    assert way.is_straight
    assert way.miss < 2e-3


@pytest.mark.slow
def test_a_target_in_an_obstacle_is_approached_to_its_border(roadmap):
    goal = goal_with((*TARGET, 0.08))
    way = roadmap.find(STRAIGHT, goal, LEAST, MARGIN)
    assert way.miss == pytest.approx(0.08 + LEAST, abs=0.01)
    assert clearance(way, [(*TARGET, 0.08)]) > 0.0


def test_an_arm_that_is_within_an_obstacle_leaves_it(roadmap):
    sphere = (0.02, 0.0, 0.55, 0.05)
    way = roadmap.find(STRAIGHT, goal_with(sphere), LEAST, MARGIN)
    lines = center_line(np.asarray(states_of(way.bends)), LENGTHS)
    gaps = np.linalg.norm(lines - sphere[:3], axis=-1).min(axis=-1) - sphere[3]
    assert gaps[0] < 0.0
    assert gaps.min() > gaps[0] - 5e-3  # checked every 3 deg
    assert gaps[-1] > 0.0
    assert way.miss < 0.006


@pytest.mark.slow
def test_a_guarded_tip_may_pass_where_the_arm_may_not(roadmap):
    sphere = (0.13, 0.0, 0.4, 0.05)  # beside the arm, below the way of the tip
    goal = goal_with(sphere)
    tip_alone = Roadmap(TWIN, MODEL, "tip").find(STRAIGHT, goal, LEAST, MARGIN)
    whole = roadmap.find(STRAIGHT, goal, LEAST, MARGIN)
    assert clearance(whole, [sphere]) > 0.0
    assert clearance(tip_alone, [sphere]) < clearance(whole, [sphere])


def drive(planner, goals):
    """Bends and outcomes of the plans of an arm that follows them exactly."""
    plans, planned = driven(planner, goals)
    return np.asarray(bends_of(planned))[1:], [plan.outcome for plan in plans]


def test_plans_are_led_past_spheres_and_come_to_rest():
    planner = Planner(TWIN, MODEL, BEST)
    shapes, outcomes = drive(planner, [goal_with(*SPHERES)] * 120)
    tips = np.asarray(states_of(shapes))[:, -1, :3]
    assert outcomes[-1] is Outcome.SOLVED
    assert np.linalg.norm(tips[-1] - TARGET) < 0.006
    table = np.array(SPHERES)
    gaps = np.linalg.norm(tips[:, None] - table[:, :3], axis=-1) - table[:, 3]
    assert gaps.min() > 0.0
    ways = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    assert ways.sum() < 0.45
    assert ways[-20:].max() < 1e-3


@pytest.mark.slow
def test_an_arm_waits_for_the_way_to_a_target_that_jumps():
    first, second = goal_with(*SPHERES, target=[-0.1, 0.0, 0.58]), goal_with(*SPHERES)
    shapes, _ = drive(Planner(TWIN, MODEL, BEST), [first] * 40 + [second] * 40)
    waits = np.abs(shapes[40:43] - shapes[39]).max()
    assert waits < np.deg2rad(0.5)
    assert np.abs(shapes[-1] - shapes[39]).max() > np.deg2rad(10.0)


@pytest.mark.slow
@pytest.mark.parametrize(("beside", "is_led"), [(0.05, True), (0.12, False)])
def test_a_straight_way_leads_where_it_comes_near_to_an_obstacle(beside, is_led):
    leader = Detour().leader(TWIN, MODEL, "arm")
    goal = goal_with((0.16, beside, 0.55, 0.05))
    leads = [leader.lead(STRAIGHT, goal, Outcome.SOLVED) for _ in range(5)]
    assert np.isinf(leads[0].room)  # it waits
    assert (leads[-1] is not None) == is_led
    if is_led:
        assert leads[-1].room > LEAST


@pytest.mark.slow
def test_an_arm_does_not_wait_while_obstacles_or_targets_move():
    moving = [goal_with((0.5 - 0.01 * k, 0.3, 0.3, 0.05)) for k in range(40)]
    shapes, _ = drive(Planner(TWIN, MODEL, BEST), moving)
    tip = np.asarray(states_of(shapes[-1:]))[0, -1, :3]
    assert np.linalg.norm(tip - TARGET) < 0.02
    places = np.linspace([0.0, 0.0, 0.6], TARGET, 40)
    led = [goal_with((0.5, 0.3, 0.3, 0.05), target=place) for place in places]
    shapes, _ = drive(Planner(TWIN, MODEL, BEST), [*previewed(led, 0.1)])
    assert np.linalg.norm(np.diff(shapes, axis=0), axis=(1, 2))[4:20].min() > 1e-3


@pytest.mark.slow
def test_plans_go_where_a_way_has_less_room_than_their_margin(roadmap):
    """Between the spheres, 2.4 cm of margin on either side leave nothing."""
    gate = [(0.16, 0.14, 0.55, 0.1), (0.19, -0.09, 0.53, 0.1)]
    way = roadmap.find(STRAIGHT, goal_with(*gate), LEAST, MARGIN)
    assert 0.0 < way.room.min() < MARGIN
    planner = Planner(TWIN, MODEL, replace(BEST, guard="arm"))
    shapes, outcomes = drive(planner, [goal_with(*gate)] * 120)
    assert outcomes[-1] is Outcome.SOLVED
    lines = center_line(np.asarray(states_of(shapes)), LENGTHS, 15)
    gaps = np.linalg.norm(lines[..., None, :] - np.array(gate)[:, :3], axis=-1) - 0.1
    assert gaps.min() > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("other", slow_after(1, ["axis", "inner module"]))
def test_other_targets_do_not_pull_against_a_way(other):
    goal = goal_with(*SPHERES)
    if other == "axis":
        goal = goal.with_axis([0.5, 0.0, 1.0])
    else:
        goal = goal.with_position([0.05, 0.0, 0.38], weight=0.3, module=1)
    errors = []
    for options in (BEST, replace(BEST, guides=())):
        shapes, _ = drive(Planner(TWIN, MODEL, options), [goal] * 150)
        tip = np.asarray(states_of(shapes[-1:]))[0, -1, :3]
        errors.append(np.linalg.norm(tip - TARGET))
    assert errors[0] < errors[1] + 0.01


def test_a_desired_shape_is_taken():
    desired = np.full((3, 2), 0.2, np.float32)
    goal = Goal.of(3)._replace(shape=desired, shape_weight=np.float32(1.0))
    shapes, _ = drive(Planner(TWIN, MODEL, BEST), [goal] * 60)
    np.testing.assert_allclose(shapes[-1], desired, atol=0.02)


def test_an_obstacle_that_is_not_finite_is_no_obstacle_to_search_past():
    leader = Detour().leader(TWIN, MODEL, "tip")
    goal = goal_with(*SPHERES)._replace(obstacles=np.full((64, 3), np.nan, np.float32))
    assert leader.lead(STRAIGHT, goal, Outcome.STALLED) is None


def test_a_search_without_a_way_is_said():
    planner = Planner(TWIN, MODEL, BEST)
    _, outcomes = drive(planner, [goal_with((*TARGET, 0.1))] * 60)
    assert outcomes[-1] is Outcome.BLOCKED


@pytest.mark.slow
def test_in_real_time_a_step_waits_for_no_search(monkeypatch):
    begun, ended, release = [], [], threading.Event()

    def slow(*_):
        begun.append(True)
        release.wait(60.0)
        ended.append(True)

    planner = Planner(TWIN, MODEL, BEST)
    planner.set_real_time(True)
    drive(planner, [goal_with()])
    monkeypatch.setattr(Roadmap, "find", slow)
    drive(planner, [goal_with(*SPHERES)] * 8)
    assert begun
    assert not ended
    release.set()


def test_without_a_longest_way_there_is_no_guide():
    leader = Detour(longest=0.0).leader(TWIN, MODEL, "tip")
    assert leader.lead(STRAIGHT, goal_with(*SPHERES), Outcome.STALLED) is None
