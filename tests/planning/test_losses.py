import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.kinematics import PCCForwardModel, configurations_from_bends
from s2c2a.planning import Goal, losses, objective, solve
from s2c2a.planning.goal import MOST_OBSTACLES
from s2c2a.planning.guard import guarded_points

change_loss, change_slope = jax.jit(losses.change_loss), jax.jit(jax.grad(losses.change_loss))
obstacle_loss, obstacle_slope = jax.jit(losses.obstacle_loss), jax.jit(jax.grad(losses.obstacle_loss))
target_loss, target_slope = jax.jit(losses.target_loss), jax.jit(jax.grad(losses.target_loss))
norm_slope = jax.jit(jax.grad(losses.norm))

RANDOM = np.random.default_rng(0)
PREDICTED, WANTED = RANDOM.normal(size=(2, 3, 3)).astype(np.float32)
WEIGHTS = np.array([0.5, 0.0, 2.0], np.float32)
CENTRES = np.array([[0.1, 0.0, 0.6], [0.0, 0.3, 0.5], [0.0, 0.0, 0.0]], np.float32)
THRESHOLDS = np.array([0.2, 0.35, 0.0], np.float32)
TIP = np.array([[0.02, 0.05, 0.55]], np.float32)
MIDDLE = np.array([[-0.03, 0.1, 0.4]], np.float32)
SCALE = 0.46
TWIN = load_arm("twin_arm")
MODEL = PCCForwardModel.of(TWIN)
GUARD_TIP, GUARD_ARM = guarded_points(TWIN, "tip"), guarded_points(TWIN, "arm")


def differences(function, place, step=1e-6):
    """Gradient by central differences, in float64."""
    place = np.asarray(place, np.float64)
    units = np.eye(place.size).reshape(-1, *place.shape)
    slopes = [(function(place + step * unit) - function(place - step * unit)) / (2 * step) for unit in units]
    return np.reshape(slopes, place.shape)


def slow_target(predicted):
    return sum(w * np.sqrt(np.sum((d - p) ** 2)) for w, d, p in zip(WEIGHTS, WANTED, predicted, strict=True))


def slow_obstacles(points):
    pairs = [(point, centre, r) for point in points for centre, r in zip(CENTRES, THRESHOLDS, strict=True) if r > 0]
    distances = [(np.sqrt(np.sum((centre - point) ** 2)), r) for point, centre, r in pairs]
    return sum((d <= r) / d for d, r in distances)


def test_a_target_costs_its_distance_times_its_weight():
    predicted = np.array([[3.0, 0.0, 0.0], [9.0, 9.0, 9.0], [0.0, 1.0, 1.0]])
    wanted = np.array([[0.0, 4.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 1.5]])
    assert float(target_loss(predicted, wanted, np.array([2.0, 0.0, 10.0]))) == pytest.approx(2 * 5 + 10 * 0.5)


def test_the_gradient_of_a_target_is_the_slope_of_its_loss():
    found = target_slope(PREDICTED, WANTED, WEIGHTS)
    np.testing.assert_allclose(found, differences(slow_target, PREDICTED), atol=1e-5)


def test_a_reached_target_pulls_nowhere():
    gradient = target_slope(WANTED, WANTED, WEIGHTS)
    np.testing.assert_array_equal(gradient, np.zeros((3, 3)))
    assert float(target_loss(WANTED, WANTED, WEIGHTS)) == 0.0


@pytest.mark.parametrize("size", [1e-15, 1e-8, 1e-3, 1.0])
def test_an_almost_reached_target_pulls_with_its_whole_weight(size):
    gradient = norm_slope(size * np.array([0.6, 0.0, -0.8]))
    np.testing.assert_allclose(gradient, [0.6, 0.0, -0.8], rtol=1e-5)


@pytest.mark.parametrize(
    ("distance", "cost"), [(0.05, 20.0), (0.0999, 10.01001), (0.1001, 0.0), (0.5, 0.0), (0.0, 1000.0), (1e-9, 1000.0)]
)
def test_an_obstacle_costs_one_over_the_distance_inside_its_threshold_and_nothing_outside(distance, cost):
    found = obstacle_loss(np.array([[distance, 0.0, 0.0]]), np.zeros((1, 3)), np.array([0.1]))
    assert float(found) == pytest.approx(cost, rel=1e-4)


def test_an_obstacle_costs_on_its_threshold_too():
    """Eq. (5): d <= r."""
    assert float(obstacle_loss(np.array([[0.25, 0.0, 0.0]]), np.zeros((1, 3)), np.array([0.25]))) == 4.0


def test_obstacles_add_up():
    expected = 1 / np.linalg.norm(CENTRES[0] - TIP[0]) + 1 / np.linalg.norm(CENTRES[1] - TIP[0])
    assert float(obstacle_loss(TIP, CENTRES, THRESHOLDS)) == pytest.approx(expected, rel=1e-5)


def test_points_that_are_guarded_add_up():
    both = float(obstacle_loss(np.concatenate([TIP, MIDDLE]), CENTRES, THRESHOLDS))
    each = [float(obstacle_loss(point, CENTRES, THRESHOLDS)) for point in (TIP, MIDDLE)]
    assert min(each) > 0
    assert both == pytest.approx(sum(each), rel=1e-6)


@pytest.mark.parametrize("points", [TIP, np.concatenate([TIP, MIDDLE])], ids=["tip", "two points"])
def test_the_gradient_of_obstacles_is_the_slope_of_their_loss(points):
    found = obstacle_slope(points, CENTRES, THRESHOLDS)
    np.testing.assert_allclose(found, differences(slow_obstacles, points), rtol=1e-4, atol=1e-4)


def test_going_down_the_obstacle_loss_leads_away_from_its_centre():
    downhill = -np.asarray(obstacle_slope(np.array([[0.03, 0.04, 0.0]]), np.zeros((1, 3)), np.array([0.1])))[0]
    np.testing.assert_allclose(downhill / np.linalg.norm(downhill), [0.6, 0.8, 0.0], atol=1e-6)


@pytest.mark.parametrize("distance", [0.0, 1e-20, 1e-6, 1e-3])
def test_the_gradient_in_the_middle_of_an_obstacle_is_finite(distance):
    gradient = obstacle_slope(np.array([[distance, 0.0, 0.0]]), np.zeros((1, 3)), np.array([0.1]))
    assert np.isfinite(gradient).all()


def test_an_unused_obstacle_costs_nothing_even_in_its_middle():
    unused = np.zeros((1, 3)), np.zeros((MOST_OBSTACLES, 3)), np.zeros(MOST_OBSTACLES)
    value, gradient = obstacle_loss(*unused), obstacle_slope(*unused)
    assert float(value) == 0.0
    np.testing.assert_array_equal(gradient, np.zeros((1, 3)))


def test_change_costs_the_norm_over_all_modules_together():
    assert float(change_loss(np.diag([2.0, 1.0, -2.0]), np.zeros((3, 3)))) == pytest.approx(3.0)


def test_the_gradient_of_change_is_its_slope_and_zero_at_no_change():
    found = change_slope(PREDICTED, WANTED)
    expected = differences(lambda place: np.sqrt(np.sum((place - WANTED) ** 2)), PREDICTED)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    np.testing.assert_array_equal(change_slope(WANTED, WANTED), np.zeros((3, 3)))


def a_rich_goal():
    goal = Goal.of(3, change_weight=0.7).with_position([0.2, 0.1, 0.5], 1.3).with_position([0.0, 0.05, 0.2], 4.0, 0)
    return goal.with_axis([1.0, 0.0, 1.0], 2.0).with_obstacles([[0.1, 0.0, 0.6], [0.5, 0.5, 0.5]], [0.3, 0.1], 0.4)


BENT = configurations_from_bends(jnp.array([[0.2, 0.1], [-0.1, 0.3], [0.4, 0.0]]))
STRAIGHT = jnp.tile(jnp.array([0.0, 0.0, 1.0]), (3, 1))


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
    found = jax.jit(objective(MODEL, (), a_rich_goal(), STRAIGHT, SCALE, GUARD_TIP))(BENT)
    assert float(found) == pytest.approx(expected, rel=1e-5)


def test_a_guarded_arm_pays_for_every_point_of_its_centre_line():
    goal = Goal.of(3).with_obstacles([[0.03, 0.0, 0.3]], [0.12], 0.4)
    distances = np.linalg.norm(np.asarray(GUARD_ARM(MODEL.predict(BENT, ()))) - [0.03, 0.0, 0.3], axis=-1)
    change = 0.5 * np.linalg.norm(np.asarray(BENT) - np.asarray(STRAIGHT))
    paid = {
        name: float(jax.jit(objective(MODEL, (), goal, STRAIGHT, SCALE, points))(BENT)) - change
        for name, points in (("tip", GUARD_TIP), ("arm", GUARD_ARM))
    }
    assert (distances <= 0.12).sum() > 1
    assert paid["tip"] == pytest.approx(0.0, abs=1e-6)
    assert paid["arm"] == pytest.approx(0.4 * np.sum(SCALE / distances[distances <= 0.12]), rel=1e-5)


def test_an_arm_at_rest_with_nothing_asked_has_no_slope():
    nothing_asked = objective(MODEL, (), Goal.of(3), STRAIGHT, SCALE, GUARD_TIP)
    value, gradient = jax.jit(jax.value_and_grad(nothing_asked))(STRAIGHT)
    assert float(value) == 0.0
    np.testing.assert_array_equal(gradient, np.zeros((3, 3)))


def onto_sphere(configurations):
    return configurations / jnp.linalg.norm(configurations, axis=-1, keepdims=True)


@jax.jit
def value_after(goal, iterations):
    value = objective(MODEL, (), goal, STRAIGHT, SCALE, GUARD_TIP)
    return value(solve(value, STRAIGHT, onto_sphere, 0.02, iterations))


@pytest.mark.parametrize("target", [[0.22, 0.0, 0.54], [-0.1, 0.2, 0.5], [2.0, 0.0, 0.3]])
def test_the_solver_strictly_lowers_the_objective(target):
    goal = Goal.of(3).with_position(target)
    values = [float(value_after(goal, iterations)) for iterations in (0, 1, 10)]
    assert values[0] > values[1] > values[2]


def test_the_solver_is_adam_with_a_projection_after_every_iteration():
    """A second Adam (Kingma and Ba 2015, algorithm 1) in float64."""
    pull = np.array([[1.0, -2.0, 0.5]])
    place, mean, square = np.array([[0.0, 0.6, 0.8]]), 0.0, 0.0
    for step in range(1, 11):
        gradient = 2 * (place - pull)
        mean, square = 0.9 * mean + 0.1 * gradient, 0.999 * square + 0.001 * gradient**2
        place = place - 0.02 * (mean / (1 - 0.9**step)) / (np.sqrt(square / (1 - 0.999**step)) + 1e-8)
        place /= np.linalg.norm(place)
    start = jnp.array([[0.0, 0.6, 0.8]])
    found = solve(lambda configurations: jnp.sum((configurations - pull) ** 2), start, onto_sphere)
    np.testing.assert_allclose(found, place, atol=2e-6)
