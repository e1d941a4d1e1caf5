"""Each term worked by hand, and the two objectives of the solvers."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from driven import MODEL, TWIN

from s2c2a.goals import MAX_OBSTACLES
from s2c2a.kinematics import configurations_from_bends, norm, states_from_bends
from s2c2a.planning import BEST, PAPER, Candidate, Goal, Situation, terms
from s2c2a.planning.planner import AXES_WEIGHT, Step
from s2c2a.planning.terms import OBSTACLES_AT_HAND as AT_HAND
from s2c2a.planning.terms import GuardedPoints

from marks import slow_after

LENGTHS = jnp.full(3, 0.2)
WHOLE_ARM = GuardedPoints.of(TWIN, "arm")
SCALE = 0.46  # m: the paper's length scale, for an arm of 0.6 m
UNIT = 0.4 * 0.6
RANDOM = np.random.default_rng(0)
PREDICTED, DESIRED = RANDOM.normal(size=(2, 3, 3)).astype(np.float32)
WEIGHTS = np.array([0.5, 0.0, 2.0], np.float32)
CENTERS = np.array([[0.1, 0.0, 0.6], [0.0, 0.3, 0.5], [0.0, 0.0, 0.0]], np.float32)
THRESHOLDS = np.array([0.2, 0.35, 0.0], np.float32)
TIP = np.array([[0.02, 0.05, 0.55]], np.float32)
MIDDLE = np.array([[-0.03, 0.1, 0.4]], np.float32)
LAST = np.array([[0.3, 0.1], [-0.2, 0.4], [0.1, -0.1]], np.float32)
NEXT = LAST + np.array([[0.02, 0.0], [0.0, -0.03], [0.01, 0.01]], np.float32)


ZEROS = np.zeros((3, 3))


def situation(goal=None, last=ZEROS, length=1.0):
    """A situation with a goal and the last configurations, else zeros."""
    zeros = np.zeros((3, 2)), np.zeros((3, 6)), np.zeros((1, 3)), np.zeros(())
    now = Candidate(last, *zeros)
    return Situation(goal or Goal.of(3), now, length, jnp.ones(3), 0.1, True)


def candidate(positions=ZEROS, points=None, configurations=None):
    """A candidate with these values, else zeros."""
    states = jnp.concatenate([positions, jnp.zeros((3, 3))], axis=1)
    return Candidate(configurations, None, states, points, np.zeros(()))


def cost_of(term, candidate, situation):
    """The sum of norms of a term, as in the paper."""
    mu, rows = term.residual(candidate, situation)
    return jnp.sum(mu * norm(rows))


def target_cost(positions, desired=DESIRED, weights=WEIGHTS):
    goal = Goal.of(3)._replace(positions=desired, position_weights=weights)
    return cost_of(terms.Positions(unit=1.0), candidate(positions), situation(goal))


def obstacle_cost(points, centers=CENTERS, thresholds=THRESHOLDS):
    spheres = jnp.zeros((len(thresholds), 8))
    goal = Goal.of(3)._replace(obstacles=centers, thresholds=thresholds, cores=spheres)
    return cost_of(terms.Repulsion(unit=1.0), candidate(points=points), situation(goal))


def change_cost(configurations, last):
    changed = candidate(configurations=configurations)
    goal = Goal.of(3, change_weight=1.0)
    return cost_of(terms.Change(), changed, situation(goal, last))


target_slope = jax.jit(jax.grad(target_cost))
obstacle_slope = jax.jit(jax.grad(obstacle_cost))
change_slope = jax.jit(jax.grad(change_cost))
target_cost = jax.jit(target_cost)
obstacle_cost = jax.jit(obstacle_cost)
change_cost = jax.jit(change_cost)
norm_slope = jax.jit(jax.grad(norm))


def differences(function, place, step=1e-6):
    """Gradient by central differences, in float64."""
    place = np.asarray(place, np.float64)
    units = np.eye(place.size).reshape(-1, *place.shape)
    slopes = [
        (function(place + step * unit) - function(place - step * unit)) / (2 * step)
        for unit in units
    ]
    return np.reshape(slopes, place.shape)


def slow_target(predicted):
    return sum(
        w * np.sqrt(np.sum((d - p) ** 2))
        for w, d, p in zip(WEIGHTS, DESIRED, predicted, strict=True)
    )


def slow_obstacles(points):
    cost = 0.0
    for point in points:
        for center, threshold in zip(CENTERS, THRESHOLDS, strict=True):
            distance = np.sqrt(np.sum((center - point) ** 2))
            cost += (distance <= threshold) / distance
    return cost


def test_a_target_costs_its_distance_times_its_weight():
    predicted = np.array([[3.0, 0.0, 0.0], [9.0, 9.0, 9.0], [0.0, 1.0, 1.0]])
    desired = np.array([[0.0, 4.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 1.5]])
    cost = target_cost(predicted, desired, np.array([2.0, 0.0, 10.0]))
    assert float(cost) == pytest.approx(2 * 5 + 10 * 0.5)


def test_the_gradient_of_a_target_is_the_slope_of_its_cost():
    found = target_slope(PREDICTED, DESIRED, WEIGHTS)
    np.testing.assert_allclose(found, differences(slow_target, PREDICTED), atol=1e-5)


def test_a_reached_target_pulls_nowhere():
    gradient = target_slope(DESIRED, DESIRED, WEIGHTS)
    np.testing.assert_array_equal(gradient, np.zeros((3, 3)))
    assert float(target_cost(DESIRED, DESIRED, WEIGHTS)) == 0.0


@pytest.mark.parametrize("size", [1e-15, 1e-8, 1e-3, 1.0])
def test_an_almost_reached_target_pulls_with_its_whole_weight(size):
    gradient = norm_slope(size * np.array([0.6, 0.0, -0.8]))
    np.testing.assert_allclose(gradient, [0.6, 0.0, -0.8], rtol=1e-5)


def aside(distance, threshold=0.1):
    """A point beside the center of one obstacle."""
    return np.array([[distance, 0.0, 0.0]]), np.zeros((1, 3)), np.array([threshold])


@pytest.mark.parametrize(
    ("distance", "cost"),
    [(0.05, 20), (0.0999, 10.01001), (0.1001, 0), (0.5, 0), (0, 1000), (1e-9, 1000)],
)
def test_an_obstacle_costs_one_over_the_distance_inside_its_threshold(distance, cost):
    assert float(obstacle_cost(*aside(distance))) == pytest.approx(cost, rel=1e-4)


def test_an_obstacle_costs_on_its_threshold_too():
    """Eq. (5): d <= r."""
    assert float(obstacle_cost(*aside(0.25, 0.25))) == 4.0


@pytest.mark.parametrize(
    "points", [TIP, np.concatenate([TIP, MIDDLE])], ids=["tip", "two points"]
)
def test_obstacles_add_up_and_their_gradient_is_the_slope_of_their_cost(points):
    cost = float(obstacle_cost(points, CENTERS, THRESHOLDS))
    assert cost == pytest.approx(slow_obstacles(points), rel=1e-5)
    found = obstacle_slope(points, CENTERS, THRESHOLDS)
    slope = differences(slow_obstacles, points)
    np.testing.assert_allclose(found, slope, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("distance", [0.0, 1e-20, 1e-6, 1e-3])
def test_the_gradient_in_the_middle_of_an_obstacle_is_finite(distance):
    assert np.isfinite(obstacle_slope(*aside(distance))).all()


def test_an_unused_obstacle_costs_nothing_even_in_its_middle():
    unused = np.zeros((1, 3)), np.zeros((MAX_OBSTACLES, 3)), np.zeros(MAX_OBSTACLES)
    value, gradient = obstacle_cost(*unused), obstacle_slope(*unused)
    assert float(value) == 0.0
    np.testing.assert_array_equal(gradient, np.zeros((1, 3)))


def test_change_costs_the_norm_over_all_modules_together():
    cost = change_cost(np.diag([2.0, 1.0, -2.0]), np.zeros((3, 3)))
    assert float(cost) == pytest.approx(3.0)


def test_the_gradient_of_change_is_its_slope_and_zero_at_no_change():
    def distance(place):
        return np.sqrt(np.sum((place - DESIRED) ** 2))

    found = change_slope(PREDICTED, DESIRED)
    np.testing.assert_allclose(found, differences(distance, PREDICTED), atol=1e-5)
    np.testing.assert_array_equal(change_slope(DESIRED, DESIRED), np.zeros((3, 3)))


def a_rich_goal():
    goal = (
        Goal.of(3, change_weight=0.7)
        .with_position([0.2, 0.1, 0.5], 1.3)
        .with_position([0.0, 0.05, 0.2], 4.0, 0)
    )
    return goal.with_axis([1.0, 0.0, 1.0], 2.0).with_obstacles(
        [[0.1, 0.0, 0.6], [0.5, 0.5, 0.5]], [0.3, 0.1], 0.4
    )


BENT = configurations_from_bends(jnp.array([[0.2, 0.1], [-0.1, 0.3], [0.4, 0.0]]))
STRAIGHT = jnp.tile(jnp.array([0.0, 0.0, 1.0]), (3, 1))


def papers_objective(goal, guard="tip", last=STRAIGHT):
    """As the paper's recipe has it, from one configuration on."""
    step = Step.of(TWIN, MODEL, replace(PAPER, guard=guard))
    return step.problem(step.started(last), goal).sum_of_norms


def test_the_objective_is_the_weighted_sum_in_units_of_the_length_scale():
    states = np.asarray(eqx.filter_jit(MODEL.predict)(BENT, ()), np.float64)
    tip, first = states[2, :3], states[0, :3]
    expected = (
        1.3 * np.linalg.norm([0.2, 0.1, 0.5] - tip) / SCALE
        + 4.0 * np.linalg.norm([0.0, 0.05, 0.2] - first) / SCALE
        + 2.0 * np.linalg.norm(np.array([1, 0, 1]) / np.sqrt(2) - states[2, 3:])
        + 0.4 * SCALE / np.linalg.norm([0.1, 0.0, 0.6] - tip)
        + 0.7 * np.linalg.norm(np.asarray(BENT) - np.asarray(STRAIGHT))
    )
    found = jax.jit(papers_objective(a_rich_goal()))(BENT)
    assert float(found) == pytest.approx(expected, rel=1e-5)


def test_a_guarded_arm_pays_for_every_point_of_its_center_line():
    goal = Goal.of(3).with_obstacles([[0.03, 0.0, 0.3]], [0.12], 0.4)
    points = np.asarray(WHOLE_ARM(MODEL.predict(BENT, ())))
    distances = np.linalg.norm(points - [0.03, 0.0, 0.3], axis=-1)
    change = 0.5 * np.linalg.norm(np.asarray(BENT) - np.asarray(STRAIGHT))
    paid = {
        guard: float(jax.jit(papers_objective(goal, guard))(BENT)) - change
        for guard in ("tip", "arm")
    }
    assert (distances <= 0.12).sum() > 1
    assert paid["tip"] == pytest.approx(0.0, abs=1e-6)
    expected = 0.4 * np.sum(SCALE / distances[distances <= 0.12])
    assert paid["arm"] == pytest.approx(expected, rel=1e-5)


def test_an_arm_at_rest_without_targets_has_zero_gradient():
    objective = jax.value_and_grad(papers_objective(Goal.of(3)))
    value, gradient = jax.jit(objective)(STRAIGHT)
    assert float(value) == 0.0
    np.testing.assert_array_equal(gradient, np.zeros((3, 3)))


@pytest.mark.parametrize("options", slow_after(1, [BEST, PAPER]))
def test_terms_of_both_recipes_work_with_both_solvers(options):
    """Sum of norms and sum of squares use the same residuals."""
    step = Step.of(TWIN, MODEL, options)
    problem = step.problem(step.started(BENT), a_rich_goal())
    bends = jnp.asarray(NEXT)
    tried = problem.candidate_at(bends, problem.memory)
    judged = [
        [np.asarray(one) for one in term.residual(tried, problem.situation)]
        for term in options.terms
    ]
    squares = sum((mu[..., None] * rows**2).sum() for mu, rows in judged)
    norms = sum((mu * np.linalg.norm(rows, axis=-1)).sum() for mu, rows in judged)
    assert squares > 0.1
    np.testing.assert_allclose(jnp.sum(problem.stacked(bends) ** 2), squares, rtol=1e-4)
    summed = problem.sum_of_norms(configurations_from_bends(bends))
    np.testing.assert_allclose(summed, norms, rtol=1e-3)


@pytest.mark.parametrize(
    "goal", [Goal.of(3), Goal.of(3).with_obstacles(CENTERS[:2], THRESHOLDS[:2])]
)
def test_unused_rows_of_obstacles_change_nothing(goal):
    """Batches leave out unused rows."""
    room = int((goal.thresholds > 0).sum())
    small = goal.with_rows(slice(room))
    for options in (PAPER, BEST):
        step = Step.of(TWIN, MODEL, options)
        problems = [step.problem(step.started(BENT), one) for one in (goal, small)]
        costs = [jnp.sum(one.stacked(jnp.asarray(NEXT)) ** 2) for one in problems]
        np.testing.assert_allclose(*costs, rtol=1e-6)


BLOCKS = {
    "position": 9,
    "axis": 9,
    "shape": 6,
    "evenness": 4,
    "extrapolation": 1,
    "limit": 3,
    "obstacle": AT_HAND,
}


@pytest.fixture(scope="module")
def residuals_at():
    """(bends, goal) -> residuals of `BEST` by name; the last plan is LAST."""
    step = Step.of(TWIN, MODEL, BEST)

    @jax.jit
    def values(bends, last, goal):
        problem = step.problem(step.started(configurations_from_bends(last)), goal)
        # exactly zero where nothing changes
        return problem.stacked(problem.situation.last.bends + (bends - last))

    def at(bends, goal, last=LAST) -> dict[str, np.ndarray]:
        every = np.asarray(values(np.float32(bends), last, goal))
        assert len(every) == sum(BLOCKS.values())
        parts = np.split(every, np.cumsum(list(BLOCKS.values()))[:-1])
        blocks = dict(zip(BLOCKS, parts, strict=True))
        ends = {name: blocks[name].reshape(3, 3) for name in ("position", "axis")}
        return blocks | ends

    return at


def state_of(bends):
    return np.asarray(states_from_bends(jnp.float32(bends), LENGTHS))


def test_without_targets_nothing_costs(residuals_at):
    """The solver counts changes."""
    blocks = residuals_at(NEXT, Goal.of(3, change_weight=0.5))
    assert all(not block.any() for block in blocks.values())


def test_a_near_target_is_missed_in_units_of_the_arm(residuals_at):
    target = state_of(LAST)[-1, :3] + np.array([0.01, 0.0, -0.005])
    goal = Goal.of(3).with_position(target, weight=4.0)
    missed = residuals_at(NEXT, goal)["position"]
    expected = 2.0 * (state_of(NEXT)[-1, :3] - target) / UNIT
    np.testing.assert_allclose(missed[-1], expected, atol=1e-5)
    assert not missed[:2].any()


def test_every_module_can_have_a_target(residuals_at):
    ends = state_of(LAST)[:, :3]
    goal = Goal.of(3).with_position(ends[0] + np.array([0.01, 0, 0]), 4.0, module=0)
    missed = residuals_at(LAST, goal.with_position(ends[2]))["position"]
    expected = [[-2 * 0.01 / UNIT, 0, 0], [0, 0, 0], [0, 0, 0]]
    np.testing.assert_allclose(missed, expected, atol=1e-5)


def test_an_axis_is_missed_as_it_is(residuals_at):
    desired = np.array([0.6, 0.0, 0.8])
    missed = residuals_at(NEXT, Goal.of(3).with_axis(desired, weight=2.0))["axis"]
    expected = AXES_WEIGHT * np.sqrt(2.0) * (state_of(NEXT)[-1, 3:] - desired)
    np.testing.assert_allclose(missed[-1], expected, atol=1e-5)
    assert not missed[:2].any()


@pytest.mark.parametrize("module", [2, 1])
def test_uneven_bends_cost_a_little_up_to_the_last_target(residuals_at, module):
    goal = Goal.of(3).with_position([0.1, 0.0, 0.3], module=module)
    uneven = residuals_at(LAST, goal)["evenness"].reshape(2, 2)
    expected = 0.02 * np.diff(LAST, axis=0)[:module]
    np.testing.assert_allclose(uneven[:module], expected, atol=1e-7)
    np.testing.assert_array_equal(uneven[module:], 0.0)


def test_extrapolation_costs_as_much_as_a_distance_of_the_tip():
    extrapolating = candidate()._replace(extrapolation=jnp.asarray(0.03))
    term = terms.Extrapolation(weight=2.0, unit=0.5)
    goal = Goal.of(3).with_position([0.1, 0.0, 0.3])
    mu, rows = term.residual(extrapolating, situation(goal, length=0.6))
    np.testing.assert_allclose(mu * rows, [[2.0 * 0.03 / 0.3]], rtol=1e-6)
    mu, _ = term.residual(extrapolating, situation(length=0.6))
    assert mu == 0.0  # an arm that is to rest must not creep towards its data


def test_a_bend_beyond_its_limit_costs_what_is_too_much(residuals_at):
    bends = np.array([[1.0, 0.0], [0.0, 0.5], [0.0, 0.0]], np.float32)
    excess = 5.0 * (1.0 - np.deg2rad(47.0))
    found = residuals_at(bends, Goal.of(3))["limit"]
    np.testing.assert_allclose(found, [excess, 0, 0], atol=1e-5)


@pytest.mark.parametrize(
    ("distance", "depth"), [(0.03, 0.05 + 0.024 - 0.03), (0.06, 0.014), (0.08, 0.0)]
)
def test_an_obstacle_costs_by_how_far_the_tip_is_within_its_threshold_and_margin(
    residuals_at, distance, depth
):
    center = state_of(LAST)[-1, :3] + np.array([0.0, distance, 0.0])
    blocks = residuals_at(LAST, Goal.of(3).with_obstacles([center], [0.05], weight=4.0))
    expected = [2.0 * 20.0 * depth / UNIT] + [0.0] * (AT_HAND - 1)
    np.testing.assert_allclose(blocks["obstacle"], expected, atol=1e-4)


def test_unused_rows_of_obstacles_cost_nothing(residuals_at):
    """Even where the tip is at their center."""
    centers = np.tile(state_of(LAST)[-1, :3], (MAX_OBSTACLES, 1))
    goal = Goal.of(3)._replace(obstacles=np.float32(centers))
    assert not residuals_at(LAST, goal)["obstacle"].any()


def test_of_many_obstacles_those_count_that_the_tip_is_deepest_in(residuals_at):
    """64 of them, all about the tip: a weight of one, and depths of 1 to 64 mm."""
    depths = 1e-3 * (1 + np.random.default_rng(0).permutation(MAX_OBSTACLES))
    away = np.random.default_rng(1).normal(size=(MAX_OBSTACLES, 3))
    away *= 0.2 / np.linalg.norm(away, axis=-1, keepdims=True)
    centers, thresholds = state_of(LAST)[-1, :3] + away, 0.2 - 0.04 * 0.6 + depths
    goal = Goal.of(3).with_obstacles(centers, thresholds)
    found = residuals_at(LAST, goal)["obstacle"]
    deepest = 1e-3 * np.arange(MAX_OBSTACLES, MAX_OBSTACLES - AT_HAND, -1)
    np.testing.assert_allclose(found, 20.0 * deepest / UNIT, atol=1e-4)


def test_a_desired_shape_costs_its_distance_in_bends(residuals_at):
    goal = Goal.of(3)
    assert not residuals_at(LAST, goal)["shape"].any()
    desired = goal._replace(shape=np.float32(LAST) + 0.1, shape_weight=np.float32(1.0))
    found = residuals_at(LAST, desired, LAST)["shape"]
    np.testing.assert_allclose(found, -0.03, atol=1e-6)


def test_an_obstacle_near_a_tip_without_target_changes_nothing(residuals_at):
    """Without a target of the tip there is no path."""
    center = state_of(LAST)[-1, :3] + np.array([0.0, 0.3, 0.0])
    blocks = residuals_at(LAST, Goal.of(3).with_obstacles([center], [0.05]))
    for name, block in blocks.items():
        # bends are converted to configurations and back
        np.testing.assert_allclose(block, 0.0, atol=1e-6, err_msg=name)
