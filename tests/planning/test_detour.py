"""Paths around obstacles on the workspace map, compared with Dijkstra's algorithm."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from s2c2a.arm import load_arm
from s2c2a.kinematics import states_from_bends
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import Goal
from s2c2a.planning.guides import (
    FAR,
    NEIGHBORS,
    SIDE,
    _shortest_paths,
    tip_target,
    workspace_map,
)

TWIN = load_arm("twin_arm")
MARGIN = 0.02
LONGEST = 0.8
target_on_path = jax.jit(tip_target)
shortest_paths = jax.jit(_shortest_paths)


def tip_of(bend):
    """Tip [m] of the arm with all modules bent alike."""
    return np.asarray(
        states_from_bends(
            jnp.tile(jnp.asarray(bend, dtype=jnp.float32), (3, 1)), jnp.full(3, 0.2)
        )
    )[-1, :3]


TIP = tip_of([0.4, -0.3])
TARGET = tip_of([0.4, 0.3])
BETWEEN = (TIP + TARGET) / 2


@pytest.fixture(scope="module")
def workspace():
    return workspace_map(TWIN, PCCForwardModel.of(TWIN), "tip")


def goal_with(*spheres):
    """A goal with obstacles (x, y, z, threshold) alone."""
    table = np.reshape(spheres, (-1, 4))
    return Goal.of(3).with_obstacles(table[:, :3], table[:, 3])


def distance_from_line(point):
    """Distance of a point from the straight path [m]."""
    direction = (TARGET - TIP) / np.linalg.norm(TARGET - TIP)
    offset = np.asarray(point) - TIP
    return np.linalg.norm(offset - (offset @ direction) * direction)


def test_the_map_has_the_tips_of_its_bends(workspace):
    for row, column in ((22, 22), (30, 10), (22, 44)):
        bend = workspace.bends[row, column]
        np.testing.assert_allclose(
            workspace.tips[row, column], tip_of(bend[0]), atol=1e-6
        )
        np.testing.assert_array_equal(bend, np.tile(bend[0], (3, 1)))
    full = np.linalg.norm(np.asarray(workspace.bends)[22, 44, 0])
    assert full == pytest.approx(np.deg2rad(47.0), abs=1e-6)


def test_edges_join_neighbors_within_the_disc_of_full_bend(workspace):
    distances = np.asarray(workspace.distances)
    tips = np.asarray(workspace.tips)
    east = NEIGHBORS.index((0, 1))
    assert distances[east, 22, 30] == pytest.approx(
        np.linalg.norm(tips[22, 31] - tips[22, 30]), abs=1e-6
    )
    assert distances[east, 22, 44] == pytest.approx(FAR)
    assert (distances[:, 0, 0] == FAR).all()
    back = NEIGHBORS.index((0, -1))
    np.testing.assert_allclose(
        distances[east, :, :-1], distances[back, :, 1:], atol=1e-6
    )


@pytest.mark.parametrize("seed", range(3))
def test_path_lengths_agree_with_dijkstra(workspace, seed):
    random = np.random.default_rng(seed)
    tips = np.asarray(workspace.tips)
    blocked = np.linalg.norm(tips - BETWEEN - random.normal(0, 0.03, 3), axis=-1) < 0.12
    remaining = shortest_paths(workspace, TARGET, jnp.asarray(blocked))[0]
    remaining = np.asarray(remaining).reshape(-1)
    free = ~blocked & (np.asarray(workspace.distances).min(axis=0) < FAR)
    pairs = [(node, node + step) for step in NEIGHBORS for node in np.argwhere(free)]
    inside = [
        (tuple(a), tuple(b))
        for a, b in pairs
        if (b >= 0).all() and (b < SIDE).all() and free[tuple(b)]
    ]
    ends = np.array(
        [[np.ravel_multi_index(node, (SIDE, SIDE)) for node in pair] for pair in inside]
    )
    lengths = [np.linalg.norm(tips[a] - tips[b]) for a, b in inside]
    missing = np.where(free, np.linalg.norm(tips - TARGET, axis=-1), np.inf).reshape(-1)
    nearest = int(missing.argmin())
    graph = coo_array((lengths, ends.T), shape=(SIDE**2, SIDE**2)).tocsr()
    expected = dijkstra(graph, indices=nearest) + missing[nearest]
    reached = np.isfinite(expected)
    assert reached.sum() > 1000
    np.testing.assert_allclose(remaining[reached], expected[reached], atol=1e-4)
    assert (remaining[~reached] >= FAR).all()


@pytest.mark.parametrize(
    "goal", [goal_with(), goal_with([*BETWEEN + np.array([0.0, 0.0, 0.3]), 0.05])]
)
def test_with_a_free_straight_path_the_target_is_unchanged(workspace, goal):
    result = target_on_path(workspace, TIP, TARGET, goal, MARGIN, LONGEST)
    np.testing.assert_allclose(result.position, TARGET, atol=1e-7)
    assert float(result.on_map) == 0.0


def test_the_path_goes_around_a_sphere(workspace):
    goal = goal_with([*BETWEEN, 0.05])
    result = target_on_path(workspace, TIP, TARGET, goal, MARGIN, LONGEST)
    assert float(result.on_map) == 1.0
    assert distance_from_line(result.position) > 0.01
    assert np.linalg.norm(result.position - BETWEEN) > 0.05 + MARGIN
    np.testing.assert_allclose(tip_of(result.bends[0]), result.position, atol=1e-5)
    assert np.linalg.norm(result.position - TIP) < 0.15


@pytest.mark.parametrize(
    "spheres",
    [[[*BETWEEN, 0.05]], [[*BETWEEN, 0.05], [*BETWEEN + np.array([0.09, 0, 0]), 0.05]]],
)
def test_the_tip_arrives_outside_of_all_spheres(workspace, spheres):
    tip = TIP
    path = [TIP]
    for _ in range(40):
        goal = goal_with(*spheres)
        result = target_on_path(workspace, tip, TARGET, goal, MARGIN, LONGEST)
        tip = np.asarray(result.position)
        path.append(tip)
    np.testing.assert_allclose(path[-1], TARGET, atol=1e-6)
    for *center, threshold in spheres:
        assert np.linalg.norm(np.array(path) - center, axis=-1).min() > threshold
    length = np.linalg.norm(np.diff(path, axis=0), axis=-1).sum()
    assert length < 2.5 * np.linalg.norm(TARGET - TIP)


def test_the_tip_waits_if_the_path_is_too_long(workspace):
    goal = goal_with([*BETWEEN, 0.05])
    result = target_on_path(workspace, TIP, TARGET, goal, MARGIN, 0.1)
    np.testing.assert_allclose(result.position, TIP, atol=1e-7)
    assert float(result.on_map) == 0.0


def test_with_a_target_in_an_obstacle_the_tip_goes_to_its_border(workspace):
    tip = TIP
    goal = goal_with([*TARGET, 0.05])
    for _ in range(40):
        result = target_on_path(workspace, tip, TARGET, goal, MARGIN, LONGEST)
        tip = np.asarray(result.position)
    assert 0.05 + MARGIN < np.linalg.norm(tip - TARGET) < 0.05 + MARGIN + 0.03


@pytest.mark.parametrize("sphere", [[*BETWEEN, 2.0], [0.0, 0.0, 1.2, 0.15]])
def test_off_the_map_the_target_is_unchanged(workspace, sphere):
    """The first sphere contains the map; above the second, no node is visible."""
    tip = TIP if sphere[3] > 1.0 else np.array([0.0, 0.0, 1.5])
    result = target_on_path(workspace, tip, TARGET, goal_with(sphere), MARGIN, LONGEST)
    np.testing.assert_allclose(result.position, TARGET, atol=1e-7)


def test_unused_obstacles_block_nothing(workspace):
    goal = goal_with([*BETWEEN, 0.05])._replace(thresholds=np.zeros(64, np.float32))
    result = target_on_path(workspace, TIP, TARGET, goal, MARGIN, LONGEST)
    np.testing.assert_allclose(result.position, TARGET, atol=1e-7)


def test_a_guarded_arm_avoids_an_obstacle_that_the_tip_alone_would_pass():
    """The obstacle is beside the middle of the arm, so low that the tip misses it."""
    middle = np.asarray(
        states_from_bends(jnp.tile(jnp.array([0.4, 0.0]), (3, 1)), jnp.full(3, 0.2))
    )[1, :3]
    goal = goal_with([*middle, 0.02])
    maps = [
        workspace_map(TWIN, PCCForwardModel.of(TWIN), guard) for guard in ("tip", "arm")
    ]
    assert maps[1].points.shape == (SIDE, SIDE, 15, 3)
    tip_only, whole_arm = (
        target_on_path(workspace, TIP, TARGET, goal, 0.01, LONGEST)
        for workspace in maps
    )
    np.testing.assert_allclose(tip_only.position, TARGET, atol=1e-7)
    assert float(whole_arm.on_map) == 1.0
