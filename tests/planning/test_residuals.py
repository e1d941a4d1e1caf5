"""The planner's residuals, block by block, worked by hand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.kinematics import PCCForwardModel, states_from_bends
from s2c2a.planning import Goal, LeastSquaresOptions
from s2c2a.planning.detour import workspace_map
from s2c2a.planning.goal import MOST_OBSTACLES
from s2c2a.planning.guard import guarded_points
from s2c2a.planning.residuals import OBSTACLES_AT_HAND as AT_HAND
from s2c2a.planning.residuals import goal_residuals

TWIN = load_arm("twin_arm")
MODEL, TIP_ONLY = PCCForwardModel.of(TWIN), guarded_points(TWIN, "tip")
LENGTHS = jnp.full(3, 0.2)
OPTIONS = LeastSquaresOptions()
UNIT, PULL = 0.4 * 0.6, 0.035 * 0.6
BLOCKS = {"position": 9, "axis": 9, "change": 6, "shape": 6, "evenness": 4, "limit": 3, "obstacle": AT_HAND}
LAST = np.array([[0.3, 0.1], [-0.2, 0.4], [0.1, -0.1]], np.float32)
NEXT = LAST + np.array([[0.02, 0.0], [0.0, -0.03], [0.01, 0.01]], np.float32)


@pytest.fixture(scope="module")
def residuals_at():
    """(bends, goal) -> blocks of residuals by name, the last plan being LAST."""
    workspace = workspace_map(TWIN, MODEL, "tip")
    limits = jnp.asarray(ArmGeometry.of(TWIN).bend_limits, dtype=jnp.float32)

    @jax.jit
    def values(bends, last, goal):
        goal = Goal(*(jnp.asarray(part) for part in goal))
        found = goal_residuals(MODEL, (), goal, last, limits, TWIN.length, TIP_ONLY, workspace, OPTIONS)
        return found(bends.reshape(-1))

    def at(bends, goal, last=LAST) -> dict[str, np.ndarray]:
        every = np.asarray(values(jnp.asarray(bends, dtype=jnp.float32), jnp.asarray(last), goal))
        assert len(every) == sum(BLOCKS.values())
        parts = np.split(every, np.cumsum(list(BLOCKS.values()))[:-1])
        return dict(zip(BLOCKS, parts, strict=True))

    return at


def state_of(bends):
    return np.asarray(states_from_bends(jnp.asarray(bends, dtype=jnp.float32), LENGTHS))


def test_nothing_asked_where_the_plan_stands_is_all_zero(residuals_at):
    for name, block in residuals_at(LAST, Goal.of(3)).items():
        np.testing.assert_allclose(block, 0.0, atol=1e-7, err_msg=name)


def test_nothing_asked_only_change_costs(residuals_at):
    blocks = residuals_at(NEXT, Goal.of(3, change_weight=0.5))
    np.testing.assert_allclose(blocks.pop("change"), 0.03 * np.sqrt(0.5) * (NEXT - LAST).reshape(-1), atol=1e-7)
    assert all(not block.any() for block in blocks.values())


def test_a_near_target_is_missed_in_units_of_the_arm(residuals_at):
    target = state_of(LAST)[-1, :3] + np.array([0.01, 0.0, -0.005])
    missed = residuals_at(NEXT, Goal.of(3).with_position(target, weight=4.0))["position"].reshape(3, 3)
    np.testing.assert_allclose(missed[-1], 2.0 * (state_of(NEXT)[-1, :3] - target) / UNIT, atol=1e-5)
    assert not missed[:2].any()


def test_a_target_far_away_pulls_no_more_than_the_longest_pull(residuals_at):
    tip, towards = state_of(LAST)[-1, :3], np.array([0.6, 0.0, 0.8])
    missed = residuals_at(LAST, Goal.of(3).with_position(tip + 0.5 * towards))["position"].reshape(3, 3)
    np.testing.assert_allclose(missed[-1], -towards * PULL / UNIT, atol=1e-5)


def test_every_module_can_be_asked_for(residuals_at):
    ends = state_of(LAST)[:, :3]
    goal = Goal.of(3).with_position(ends[0] + np.array([0.01, 0, 0]), weight=4.0, module=0).with_position(ends[2])
    missed = residuals_at(LAST, goal)["position"].reshape(3, 3)
    np.testing.assert_allclose(missed, [[-2 * 0.01 / UNIT, 0, 0], [0, 0, 0], [0, 0, 0]], atol=1e-5)


def test_an_axis_is_missed_as_it_is(residuals_at):
    wanted = np.array([0.6, 0.0, 0.8])
    missed = residuals_at(NEXT, Goal.of(3).with_axis(wanted, weight=2.0))["axis"].reshape(3, 3)
    np.testing.assert_allclose(missed[-1], np.sqrt(2.0) * (state_of(NEXT)[-1, 3:] - wanted), atol=1e-5)
    assert not missed[:2].any()


def test_uneven_bends_cost_a_little_where_something_is_asked(residuals_at):
    blocks = residuals_at(LAST, Goal.of(3).with_position([0.1, 0.0, 0.5]))
    np.testing.assert_allclose(blocks["evenness"], 0.02 * np.diff(LAST, axis=0).reshape(-1), atol=1e-7)


def test_a_bend_beyond_its_limit_costs_what_is_too_much(residuals_at):
    bends = np.array([[1.0, 0.0], [0.0, 0.5], [0.0, 0.0]], np.float32)
    excess = 5.0 * (1.0 - np.deg2rad(47.0))
    np.testing.assert_allclose(residuals_at(bends, Goal.of(3))["limit"], [excess, 0, 0], atol=1e-5)


@pytest.mark.parametrize(("distance", "depth"), [(0.03, 0.05 + 0.024 - 0.03), (0.06, 0.014), (0.08, 0.0)])
def test_an_obstacle_costs_by_how_far_the_tip_is_within_its_threshold_and_margin(residuals_at, distance, depth):
    centre = state_of(LAST)[-1, :3] + np.array([0.0, distance, 0.0])
    blocks = residuals_at(LAST, Goal.of(3).with_obstacles([centre], [0.05], weight=4.0))
    np.testing.assert_allclose(blocks["obstacle"], [2.0 * 20.0 * depth / UNIT] + [0.0] * (AT_HAND - 1), atol=1e-4)


def test_places_for_obstacles_that_are_not_in_use_cost_nothing(residuals_at):
    """Even where the tip stands on their centre."""
    goal = Goal.of(3)._replace(obstacles=np.tile(state_of(LAST)[-1, :3], (MOST_OBSTACLES, 1)).astype(np.float32))
    assert not residuals_at(LAST, goal)["obstacle"].any()


def test_of_many_obstacles_those_count_that_the_tip_is_deepest_in(residuals_at):
    """64 of them, all about the tip: a weight of one, and depths of 1 to 64 mm."""
    depths = 1e-3 * np.random.default_rng(0).permutation(np.arange(1, MOST_OBSTACLES + 1))
    away = np.random.default_rng(1).normal(size=(MOST_OBSTACLES, 3))
    away *= 0.2 / np.linalg.norm(away, axis=-1, keepdims=True)
    centres, thresholds = state_of(LAST)[-1, :3] + away, 0.2 - 0.04 * 0.6 + depths
    found = residuals_at(LAST, Goal.of(3).with_obstacles(centres, thresholds))["obstacle"]
    deepest = 1e-3 * np.arange(MOST_OBSTACLES, MOST_OBSTACLES - AT_HAND, -1)
    np.testing.assert_allclose(found, 20.0 * deepest / UNIT, atol=1e-4)


def test_round_an_obstacle_the_tip_is_drawn_aside_and_shape_counts(residuals_at):
    """From a shape of the map, straight through, and past a sphere half way."""
    last = np.tile(np.float32([0.4, -0.2]), (3, 1))
    tip, target = (state_of(np.tile(bend, (3, 1)))[-1, :3] for bend in ([0.4, -0.2], [0.4, 0.2]))
    free = Goal.of(3).with_position(target)
    past = free.with_obstacles([(tip + target) / 2], [0.05])
    straight, aside = (residuals_at(last, goal, last)["position"].reshape(3, 3)[-1] for goal in (free, past))
    straight, aside = straight / np.linalg.norm(straight), aside / np.linalg.norm(aside)
    np.testing.assert_allclose(straight, (tip - target) / np.linalg.norm(tip - target), atol=1e-4)
    assert straight @ aside < 0.99
    assert not residuals_at(last, free, last)["shape"].any()
    shape = residuals_at(last, past, last)["shape"].reshape(3, 2)
    lengths = np.linalg.norm(shape, axis=-1)
    assert lengths.max() > 0.0
    assert lengths.max() <= 0.3 * np.deg2rad(2.0) + 1e-6


def test_an_obstacle_beside_an_untargeted_tip_draws_nothing(residuals_at):
    """With nothing asked of the tip there is no way to be found."""
    goal = Goal.of(3).with_obstacles([state_of(LAST)[-1, :3] + np.array([0.0, 0.3, 0.0])], [0.05])
    blocks = residuals_at(LAST, goal)
    assert all(not block.any() for block in blocks.values())


def test_the_tip_alone_or_the_whole_centre_line_is_guarded():
    states = jnp.asarray(state_of(LAST))
    np.testing.assert_array_equal(TIP_ONLY(states), states[-1:, :3])
    points = np.asarray(guarded_points(TWIN, "arm")(states))
    assert points.shape == (15, 3)
    np.testing.assert_allclose(points[4::5], states[:, :3], atol=1e-6)
