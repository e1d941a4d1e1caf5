"""Orientation of drawn arms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from s2c2a.viz.mounting import ABOVE, SIDE, Mounting, Surroundings


@pytest.fixture(scope="session")
def mounted(make_arm):
    return lambda *gravity: make_arm(gravity_direction=gravity)


def directions():
    angles = st.tuples(st.floats(0, np.pi), st.floats(-np.pi, np.pi))
    return angles.map(
        lambda at: (
            np.sin(at[0]) * np.cos(at[1]),
            np.sin(at[0]) * np.sin(at[1]),
            np.cos(at[0]),
        )
    )


@pytest.mark.parametrize(
    ("gravity", "word", "tip"),
    [
        ((0, 0, -1), "stands", (0, 0, 1)),
        ((0, 0, 0), "floats", (0, 0, 1)),
        ((0, 0, 1), "hangs", (0, 0, -1)),
        ((1, 0, 0), "lies", (1, 0, 0)),
        ((0, -1, 0), "lies", (1, 0, 0)),
        ((0.6, 0, -0.8), "stands", (0.6, 0, 0.8)),
    ],
)
def test_the_direction_of_gravity_decides_the_mounting(mounted, gravity, word, tip):
    mounting = Mounting.of(mounted(*gravity))
    assert mounting.word == word
    along = mounting.turn @ (0, 0, 1)
    np.testing.assert_allclose(
        [np.hypot(*along[:2]), along[2]], [np.hypot(*tip[:2]), tip[2]], atol=1e-12
    )


@given(directions())
def test_the_rotation_to_the_world_turns_gravity_down(mounted, gravity):
    mounting = Mounting.of(mounted(*gravity))
    np.testing.assert_allclose(mounting.turn @ mounting.turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(mounting.turn) == pytest.approx(1.0)
    np.testing.assert_allclose(mounting.turn @ gravity, (0, 0, -1), atol=1e-12)


@given(directions())
def test_flat_drawings_show_the_arm_with_gravity_downward(mounted, gravity):
    mounting = Mounting.of(mounted(*gravity))
    (right, up), (_, backward) = mounting.flat(SIDE)
    assert 2 in {right, up}
    assert (up == 2) == (mounting.word != "lies")
    assert gravity[up] * (-1 if backward else 1) <= 0
    assert mounting.flat(ABOVE)[0][0] == right
    assert {right, up, mounting.flat(ABOVE)[0][1]} == {0, 1, 2}


def test_the_base_frame_of_a_standing_arm_is_the_world(mounted):
    mounting = Mounting.of(mounted(0, 0, -1))
    np.testing.assert_array_equal(mounting.turn, np.eye(3))
    assert mounting.flat(SIDE) == ((0, 2), (False, False))
    np.testing.assert_array_equal(mounting.placed((1.0, 2.0, 3.0)), (1, 2, 3))


def test_hanging_and_lying_arms_have_a_gravity_arrow(mounted):
    for gravity in ((0, 0, -1), (0, 0, 0)):
        assert Surroundings.of(mounted(*gravity)).arrow is None
    for gravity in ((0, 0, 1), (1, 0, 0)):
        tail, tip = Surroundings.of(mounted(*gravity)).arrow
        direction = (tip - tail) / np.linalg.norm(tip - tail)
        np.testing.assert_allclose(direction, gravity, atol=1e-12)


def test_the_ground_is_below_the_base_and_ends_on_a_circle(mounted):
    surroundings = Surroundings.of(mounted(0, 0, -1))
    assert surroundings.spacing == 0.05
    distances = np.linalg.norm(surroundings.grid[..., :2], axis=-1)
    np.testing.assert_allclose(distances, surroundings.radius, atol=1e-4)
    np.testing.assert_allclose(surroundings.grid[..., 2], surroundings.level)
    assert surroundings.level < 0


def test_one_grid_line_along_each_axis_passes_through_the_origin(mounted):
    surroundings = Surroundings.of(mounted(0, 0, -1))
    lines = surroundings.grid[surroundings.through_origin]
    radius = surroundings.radius
    ends = [[[0, -radius], [0, radius]], [[-radius, 0], [radius, 0]]]
    np.testing.assert_allclose(lines[..., :2], ends, atol=1e-12)
