"""Distances from obstacles: analytic solids, random solids against many points of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from s2c2a.goals import Goal
from s2c2a.obstacles import (
    CENTER,
    CORE,
    THRESHOLD,
    distances,
    normal_of,
    rows_of,
    swept,
)
from s2c2a.planning import motion
from s2c2a.tasks.scenes import HalfSpace

POINT = np.zeros(8)


def core(half_edges=(0.0, 0.0, 0.0), disc=0.0, turn=(0.0, 0.0, 0.0, 0.0)):
    return np.array([*turn, *half_edges, disc])


@pytest.mark.parametrize(
    ("solid", "point", "expected"),
    [
        (core(), [0.3, 0.0, 0.4], 0.5),
        (core((0, 0, 0.2)), [0.3, 0.0, 0.6], 0.5),
        (core((0, 0, 0.2)), [0.3, 0.4, 0.1], 0.5),
        (core((0.1, 0.2, 0.3)), [0.4, 0.2, 0.7], 0.5),
        (core((0.1, 0.2, 0.3)), [0.0, 0.15, 0.0], -0.05),
        (core((0, 0, 0.3), 0.1), [0.3, 0.4, 0.0], 0.4),
        (core((0, 0, 0.3), 0.1), [0.0, 0.05, 0.1], -0.05),
        (core((0, 0, 0.3), 0.1), [0.0, 0.4, 0.7], 0.5),
    ],
)
def test_distances_of_known_solids(solid, point, expected):
    found = distances(np.array(point), np.zeros(3), solid)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_distances_of_turned_boxes_agree_with_their_nearest_points():
    random = np.random.default_rng(3)
    grid = np.linspace(-1.0, 1.0, 21)
    angles = np.linspace(0.0, 2.0 * np.pi, 61)
    rim = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    for _ in range(10):
        turn = Rotation.random(random_state=random)
        half, disc = random.uniform(0.05, 0.2, 3), random.uniform(0.0, 0.1)
        center = random.normal(0.0, 0.1, 3)
        direction = random.normal(size=3)
        point = center + 0.8 * direction / np.linalg.norm(direction)  # outside
        box = half * np.stack(np.meshgrid(grid, grid, grid), axis=-1).reshape(-1, 3)
        local = turn.inv().apply(point - center)
        offsets = local - box[:, None] - disc * rim
        nearest = np.linalg.norm(offsets, axis=-1).min()
        found = distances(point, center, core(half, disc, turn.as_quat()))
        assert 0.0 < nearest - found + 1e-9 < 0.01


@pytest.mark.slow
def test_gradients_are_finite_everywhere_and_of_length_one_outside():
    solids = jnp.array([core(), core((0, 0, 0.2)), core((0.1, 0.1, 0.1), 0.05)])
    slope = jax.vmap(jax.grad(distances), (None, None, 0))
    center = jnp.zeros(3)
    assert jnp.isfinite(slope(center, center, solids)).all()
    outside = slope(jnp.array([0.4, 0.3, 0.5]), center, solids)
    np.testing.assert_allclose(jnp.linalg.norm(outside, axis=1), 1.0, rtol=1e-5)


def test_rows_of_spheres_get_points_as_cores():
    rows = rows_of(np.ones((5, 2, 4)))
    assert rows.shape == (5, 2, 12)
    assert not rows[..., 4:].any()


@pytest.mark.slow
@pytest.mark.parametrize("library", [np, jnp])
def test_what_moves_covers_its_way_and_what_is_absent_stays_absent(library):
    box = core((0.1, 0.1, 0.1))
    cores = library.asarray(np.array([POINT, box, box]))
    thresholds = library.asarray(np.array([0.1, 0.1, 0.0]))
    ways = library.asarray(np.tile([0.0, 0.4, 0.0], (3, 1)))
    larger, covering = swept(thresholds, cores, ways)
    np.testing.assert_allclose(larger, [0.1, 0.3, 0.0], rtol=1e-6)
    ends = library.asarray(np.array([[0.0, 0.2, 0.0], [0.0, -0.2, 0.0]]))
    gaps = distances(ends, library.zeros((2, 3)), covering[:1])
    np.testing.assert_allclose(gaps, 0.0, atol=1e-6)
    np.testing.assert_array_equal(covering[1:], cores[1:])


@pytest.mark.slow
def test_what_stands_still_covers_no_way_and_what_moves_has_a_gradient():
    def covered(ways):
        return jnp.sum(swept(jnp.ones(1), jnp.zeros((1, 8)), ways)[1])

    assert jnp.isfinite(jax.grad(covered)(jnp.ones((1, 3)))).all()
    still = swept(jnp.ones(1), jnp.zeros((1, 8)), jnp.zeros((1, 3)))
    np.testing.assert_array_equal(still[0], [1.0])
    np.testing.assert_array_equal(still[1], np.zeros((1, 8)))


@pytest.mark.parametrize("normal", [[0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 2, -0.5]])
def test_a_half_space_is_flat_wherever_its_point_is(normal):
    direction = np.divide(normal, np.linalg.norm(normal))
    along = np.cross(direction, [0.3, -0.2, 0.9])
    wall = HalfSpace(point=tuple(0.2 * direction + 20.0 * along), normal=normal)
    row = wall.rows()[0]
    np.testing.assert_allclose(normal_of(row), direction, atol=1e-9)
    place = 0.5 * direction - 0.4 * along
    gap = distances(place, row[CENTER], row[CORE]) - row[THRESHOLD]
    assert gap == pytest.approx(0.3, abs=1e-3)


def test_slopes_do_not_depend_on_equal_values():
    """Those of a largest or least entry are 0 / 0 where a compiler rounds it twice."""
    goal = Goal.of(3).with_obstacles([[0.1, 0.2, 0.3]], [0.05])
    point = jnp.asarray([0.2, 0.1, 0.3])

    def distance(point):
        return distances(point, goal.obstacles[0], goal.cores[0])

    def gap(point):
        return motion._gap(point, goal)

    for function in (distance, gap):
        program = str(jax.make_jaxpr(jax.grad(function))(point))
        assert "reduce_m" not in program
        np.testing.assert_allclose(
            jax.grad(function)(point), [0.5**0.5, -(0.5**0.5), 0.0], atol=1e-6
        )


def test_without_obstacles_there_is_no_gap():
    assert motion._gap(jnp.zeros(3), Goal.of(3)) == np.inf
    nothing = Goal.of(3)._replace(
        obstacles=np.zeros((0, 3)), thresholds=np.zeros(0), cores=np.zeros((0, 8))
    )
    assert motion._gap(jnp.zeros(3), nothing) == np.inf
