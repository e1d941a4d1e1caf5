"""Damped least squares alone, and in the planner of an arm that PCC models exactly."""

import logging
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from driven import STRAIGHT, TWIN, bends_of, driven, jumping_goals, states_of, tips_of

from s2c2a.goals import previewed
from s2c2a.kinematics import configurations_from_bends
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import BEST, Goal, Planner
from s2c2a.planning.solvers import solve_least_squares
from s2c2a.tasks import load_task
from s2c2a_experiments.planners.one_step import LeastSquares

from marks import slow_after


def identity(point):
    return point


def solved(residuals, start, project=identity, iterations=20):
    def solve(point):
        return solve_least_squares(residuals, point, project, iterations)[0]

    return np.asarray(jax.jit(solve)(jnp.asarray(start)))


def valley(point):
    """Rosenbrock's valley as residuals: zero at (1, 1)."""
    return jnp.array([10.0 * (point[1] - point[0] ** 2), 1.0 - point[0]])


def test_a_linear_problem_is_solved_exactly():
    random = np.random.default_rng(0)
    matrix = random.normal(size=(9, 4)).astype(np.float32)
    right = random.normal(size=9).astype(np.float32)
    expected = np.linalg.lstsq(matrix, right)[0]
    found = solved(lambda x: matrix @ x - right, np.zeros(4, np.float32))
    np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize("start", [[-1.2, 1.0], [0.0, 0.0], [2.0, -3.0]])
def test_a_curved_valley_is_followed_to_its_end(start):
    end = solved(valley, np.array(start, np.float32), iterations=60)
    np.testing.assert_allclose(end, [1.0, 1.0], atol=1e-3)


@pytest.mark.parametrize("iterations", [1, 2, 5, 20])
def test_the_sum_never_ends_above_where_it_began(iterations):
    """Residuals whose full steps overshoot wildly."""

    def wild(point):
        return jnp.concatenate([jnp.sin(5.0 * point), point**3 - 1.0])

    random = np.random.default_rng(iterations)
    starts = random.normal(0, 2, (50, 3)).astype(np.float32)
    ends = jax.vmap(lambda s: solve_least_squares(wild, s, identity, iterations)[0])
    before = np.asarray(jax.vmap(wild)(starts)) ** 2
    after = np.asarray(jax.vmap(wild)(jax.jit(ends)(starts))) ** 2
    assert (after.sum(axis=1) <= before.sum(axis=1)).all()
    assert after.sum() < 0.9 * before.sum()


def test_the_projection_is_respected_from_the_start_on():
    """The nearest point to (3, 1) on the unit disc; the start is outside of it."""

    def onto_disc(point):
        return point / jnp.maximum(1.0, jnp.linalg.norm(point))

    target = np.array([3.0, 1.0], np.float32)
    start = np.array([-4.0, 0.5], np.float32)
    end = solved(lambda x: x - target, start, onto_disc, iterations=60)
    assert np.linalg.norm(end) <= 1.0 + 1e-6
    np.testing.assert_allclose(end, target / np.sqrt(10.0), atol=0.02)


def test_with_nan_residuals_the_start_is_returned():
    start = np.array([0.3, 0.4], np.float32)
    np.testing.assert_array_equal(solved(lambda x: x * jnp.nan, start), start)


def planner_of(arm, **options):
    return Planner(arm, PCCForwardModel.of(arm), replace(BEST, **options))


@pytest.fixture(scope="module")
def planner():
    """Guards the tip."""
    return planner_of(TWIN)


def drive(planner, goals, start=STRAIGHT):
    """The start and all plans, for an arm that follows its plan exactly."""
    return driven(planner, goals, start)[1]


def clearance(points, task) -> float:
    """Least distance of points (steps, points, 3) from the task's thresholds [m]."""
    obstacles = task.obstacles()[:, None]
    distances = np.linalg.norm(points[:, :, None] - obstacles[..., :3], axis=-1)
    return float((distances - obstacles[..., 3]).min())


def bend_angles(planned):
    return np.rad2deg(np.linalg.norm(bends_of(planned), axis=-1))


def changes_deg(planned):
    changes = np.diff(bends_of(planned), axis=0)
    return np.rad2deg(np.linalg.norm(changes, axis=-1))


def test_the_circle_is_followed_within_half_a_millimeter_and_its_corner_is_rounded(
    planner,
):
    task = load_task("circle", TWIN)
    tips = tips_of(drive(planner, previewed(task.goals, TWIN.control_period)))
    errors = np.linalg.norm(tips - task.desired_positions()[:, -1], axis=-1)
    assert np.quantile(errors, 0.9) < 5e-4
    assert errors.max() < 2e-3


def test_a_tilted_circle_is_followed_in_place_and_axis(planner):
    task = load_task("tilt-50", TWIN)
    states = np.asarray(states_of(drive(planner, task.goals)))[1:, -1]
    misses = np.linalg.norm(states[:, :3] - task.desired_positions()[:, -1], axis=-1)
    assert misses.max() < 2e-3
    turned = np.linalg.norm(states[:, 3:] - task.desired_axes()[:, -1], axis=-1)
    assert turned.max() < np.deg2rad(1.0)


def test_steps_and_bends_stay_within_their_limits(planner):
    planned = drive(planner, jumping_goals(0, 300))
    changes = changes_deg(planned)
    bends = bend_angles(planned)
    assert np.isfinite(planned).all()
    assert 3.9 < changes.max() <= 4.0 + 0.01
    assert 46.0 < bends.max() <= 47.0 + 0.01


def test_an_arm_beyond_its_bend_limit_returns_step_by_step(planner):
    bends = jnp.deg2rad(jnp.array([[60.0, 0.0], [0.0, 55.0], [10.0, 0.0]]))
    start = np.asarray(configurations_from_bends(bends))
    planned = drive(planner, [Goal.of(3).with_position([0.2, 0.1, 0.5])] * 30, start)
    assert changes_deg(planned).max() <= 4.0 + 0.01
    assert bend_angles(planned)[-10:].max() <= 47.0 + 0.01


@pytest.mark.parametrize(
    "invalid",
    [
        {"positions": np.full((3, 3), np.nan, np.float32)},
        {"change_weight": np.float32(np.nan)},
    ],
)
def test_a_goal_that_is_not_finite_leaves_the_plan_unchanged(planner, invalid):
    sound = Goal.of(3).with_position([0.2, 0.0, 0.5])
    bad = sound._replace(**invalid)
    planned = drive(planner, [sound] * 3 + [bad] * 2 + [sound] * 3)
    np.testing.assert_allclose(planned[4:6], planned[[3, 3]], atol=1e-6)
    np.testing.assert_allclose(planned[5:], drive(planner, [sound] * 6)[3:], atol=1e-4)


@pytest.mark.parametrize("weight", [0.0, 0.5])
def test_without_a_target_nothing_moves(planner, weight):
    bends = jnp.array([[0.3, 0.1], [-0.2, 0.4], [0.0, 0.1]])
    start = np.asarray(configurations_from_bends(bends))
    planned = drive(planner, [Goal.of(3, change_weight=weight)] * 10, start)
    np.testing.assert_allclose(planned, np.tile(start, (11, 1, 1)), atol=1e-6)


def test_with_a_far_target_the_arm_comes_to_rest(planner):
    planned = drive(planner, [Goal.of(3).with_position([1.2, -1.6, 0.3])] * 120)
    assert np.isfinite(planned).all()
    assert np.ptp(tips_of(planned)[-20:], axis=0).max() < 0.01


@pytest.mark.parametrize(
    "name", slow_after(1, ["reach-1", "risk-a", "reach-2", "risk-c"])
)
def test_a_target_behind_obstacles_is_reached_and_the_tip_is_never_inside(
    planner, name
):
    task = load_task(name, TWIN)
    tips = tips_of(drive(planner, task.goals))
    misses = np.linalg.norm(tips[-10:] - task.desired_positions()[-1, -1], axis=-1)
    assert misses.max() < 0.03
    assert clearance(tips[:, None], task) > 0.0


@pytest.mark.slow
def test_if_every_path_is_too_long_the_tip_waits_outside(planner):
    task = load_task("risk-b", TWIN)
    tips = tips_of(drive(planner, task.goals))
    assert clearance(tips[:, None], task) > 0.0
    assert np.ptp(tips[-30:], axis=0).max() < 0.01


def test_a_tip_inside_an_obstacle_moves_out_and_stops(planner):
    center = np.array([0.03, 0.02, 0.59])
    goal = Goal.of(3, change_weight=0.5).with_obstacles([center], [0.10])
    tips = tips_of(drive(planner, [goal] * 100))
    distances = np.linalg.norm(tips - center, axis=-1)
    assert distances[-10:].min() > 0.10
    assert np.ptp(distances[-10:]) < 1e-3


def compilations(caplog):
    messages = [record.getMessage() for record in caplog.records]
    return [text for text in messages if "Finished XLA compilation" in text]


def test_the_first_plan_compiles_and_the_next_ones_do_not(caplog, make_arm):
    with jax.log_compiles(), caplog.at_level(logging.DEBUG):
        planner = planner_of(make_arm(1), solver=LeastSquares(3))
        drive(planner, [Goal.of(1)], STRAIGHT[:1])
        assert any("next_plan" in message for message in compilations(caplog))
        planner.set_real_time(True)
        caplog.clear()
        drive(planner, [Goal.of(1), *jumping_goals(5, 60, modules=1)], STRAIGHT[:1])
        many = Goal.of(1).with_obstacles(np.ones((8, 3)), np.ones(8), weight=3)
        drive(planner, [many], STRAIGHT[:1])
        assert compilations(caplog) == []
