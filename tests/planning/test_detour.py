"""Ways round obstacles on the coarse map, against a second search, and by what a way has to be."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from s2c2a.arm import load_arm
from s2c2a.kinematics import PCCForwardModel, states_from_bends
from s2c2a.planning import Goal
from s2c2a.planning.guides import (
    FAR,
    NEIGHBORS,
    SIDE,
    _ways_to,
    drawn_along,
    workspace_map,
)

TWIN = load_arm("twin_arm")
MARGIN, LONGEST = 0.02, 0.8
draw = jax.jit(drawn_along)
ways_to = jax.jit(_ways_to)


def tip_of(bend):
    """Tip [m] of the arm bent everywhere alike."""
    return np.asarray(
        states_from_bends(
            jnp.tile(jnp.asarray(bend, dtype=jnp.float32), (3, 1)), jnp.full(3, 0.2)
        )
    )[-1, :3]


TIP, TARGET = tip_of([0.4, -0.3]), tip_of([0.4, 0.3])
BETWEEN = (TIP + TARGET) / 2


@pytest.fixture(scope="module")
def workspace():
    return workspace_map(TWIN, PCCForwardModel.of(TWIN), "tip")


def past(*spheres):
    """A goal that only knows obstacles (x, y, z, threshold)."""
    table = np.reshape(spheres, (-1, 4))
    return Goal.of(3).with_obstacles(table[:, :3], table[:, 3])


def off_the_line(point):
    """Distance of a point from the straight way [m]."""
    along = (TARGET - TIP) / np.linalg.norm(TARGET - TIP)
    apart = np.asarray(point) - TIP
    return np.linalg.norm(apart - (apart @ along) * along)


def test_the_map_has_the_tips_of_its_bends(workspace):
    for row, column in ((22, 22), (30, 10), (22, 44)):
        bend = workspace.bends[row, column]
        np.testing.assert_allclose(
            workspace.tips[row, column], tip_of(bend[0]), atol=1e-6
        )
        np.testing.assert_array_equal(bend, np.tile(bend[0], (3, 1)))
    full = np.linalg.norm(np.asarray(workspace.bends)[22, 44, 0])
    assert full == pytest.approx(np.deg2rad(47.0), abs=1e-6)


def test_ways_lead_to_neighbors_and_never_out_of_the_disc_of_full_bend(workspace):
    ways, tips = np.asarray(workspace.ways), np.asarray(workspace.tips)
    east = NEIGHBORS.index((0, 1))
    assert ways[east, 22, 30] == pytest.approx(
        np.linalg.norm(tips[22, 31] - tips[22, 30]), abs=1e-6
    )
    assert ways[east, 22, 44] == pytest.approx(FAR)
    assert (ways[:, 0, 0] == FAR).all()
    back = NEIGHBORS.index((0, -1))
    np.testing.assert_allclose(ways[east, :, :-1], ways[back, :, 1:], atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_lengths_of_ways_agree_with_dijkstra(workspace, seed):
    random = np.random.default_rng(seed)
    tips = np.asarray(workspace.tips)
    blocked = np.linalg.norm(tips - BETWEEN - random.normal(0, 0.03, 3), axis=-1) < 0.12
    to_go = np.asarray(ways_to(workspace, TARGET, jnp.asarray(blocked))[0])
    free = ~blocked & (np.asarray(workspace.ways).min(axis=0) < FAR)
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
    np.testing.assert_allclose(to_go.reshape(-1)[reached], expected[reached], atol=1e-4)
    assert (to_go.reshape(-1)[~reached] >= FAR).all()


@pytest.mark.parametrize(
    "goal", [past(), past([*BETWEEN + np.array([0.0, 0.0, 0.3]), 0.05])]
)
def test_where_the_straight_way_is_free_the_target_itself_draws(workspace, goal):
    drawn = draw(workspace, TIP, TARGET, goal, MARGIN, LONGEST)
    np.testing.assert_allclose(drawn.position, TARGET, atol=1e-7)
    assert float(drawn.on_the_map) == 0.0


def test_a_sphere_in_between_is_gone_round(workspace):
    goal = past([*BETWEEN, 0.05])
    drawn = draw(workspace, TIP, TARGET, goal, MARGIN, LONGEST)
    assert float(drawn.on_the_map) == 1.0
    assert off_the_line(drawn.position) > 0.01
    assert np.linalg.norm(drawn.position - BETWEEN) > 0.05 + MARGIN
    np.testing.assert_allclose(tip_of(drawn.bends[0]), drawn.position, atol=1e-5)
    assert np.linalg.norm(drawn.position - TIP) < 0.15


@pytest.mark.parametrize(
    "spheres",
    [[[*BETWEEN, 0.05]], [[*BETWEEN, 0.05], [*BETWEEN + np.array([0.09, 0, 0]), 0.05]]],
)
def test_drawn_from_point_to_point_the_tip_arrives_outside_of_all_spheres(
    workspace, spheres
):
    tip, way = TIP, [TIP]
    for _ in range(40):
        tip = np.asarray(
            draw(workspace, tip, TARGET, past(*spheres), MARGIN, LONGEST).position
        )
        way.append(tip)
    np.testing.assert_allclose(way[-1], TARGET, atol=1e-6)
    for *center, threshold in spheres:
        assert np.linalg.norm(np.array(way) - center, axis=-1).min() > threshold
    length = np.linalg.norm(np.diff(way, axis=0), axis=-1).sum()
    assert length < 2.5 * np.linalg.norm(TARGET - TIP)


def test_a_way_that_is_too_long_is_not_taken(workspace):
    drawn = draw(workspace, TIP, TARGET, past([*BETWEEN, 0.05]), MARGIN, 0.1)
    np.testing.assert_allclose(drawn.position, TIP, atol=1e-7)
    assert float(drawn.on_the_map) == 0.0


def test_a_target_within_an_obstacle_draws_the_tip_to_its_border(workspace):
    drawn_to = TIP
    for _ in range(40):
        drawn_to = np.asarray(
            draw(
                workspace, drawn_to, TARGET, past([*TARGET, 0.05]), MARGIN, LONGEST
            ).position
        )
    assert 0.05 + MARGIN < np.linalg.norm(drawn_to - TARGET) < 0.05 + MARGIN + 0.03


@pytest.mark.parametrize("sphere", [[*BETWEEN, 2.0], [0.0, 0.0, 1.2, 0.15]])
def test_off_the_map_there_is_no_way_round_and_the_target_draws(workspace, sphere):
    """Everything lies within the one; above the other, the tip sees no node."""
    tip = TIP if sphere[3] > 1.0 else np.array([0.0, 0.0, 1.5])
    drawn = draw(workspace, tip, TARGET, past(sphere), MARGIN, LONGEST)
    np.testing.assert_allclose(drawn.position, TARGET, atol=1e-7)


def test_obstacles_that_are_not_in_use_block_nothing(workspace):
    goal = past([*BETWEEN, 0.05])._replace(thresholds=np.zeros(64, np.float32))
    np.testing.assert_allclose(
        draw(workspace, TIP, TARGET, goal, MARGIN, LONGEST).position, TARGET, atol=1e-7
    )


def test_a_guarded_arm_turns_aside_where_its_tip_alone_would_pass():
    """An obstacle beside the middle of the straight way's shapes, low enough that the tip never meets it."""
    middle = np.asarray(
        states_from_bends(jnp.tile(jnp.array([0.4, 0.0]), (3, 1)), jnp.full(3, 0.2))
    )[1, :3]
    goal = past([*middle, 0.02])
    maps = [
        workspace_map(TWIN, PCCForwardModel.of(TWIN), guard) for guard in ("tip", "arm")
    ]
    assert maps[1].points.shape == (SIDE, SIDE, 15, 3)
    tip_alone, whole = (draw(one, TIP, TARGET, goal, 0.01, LONGEST) for one in maps)
    np.testing.assert_allclose(tip_alone.position, TARGET, atol=1e-7)
    assert float(whole.on_the_map) == 1.0
