"""A moved camera, a payload and larger pulls are told apart."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from s2c2a.logs.session_change import describe_change, find_change

ROWS = 400


@pytest.fixture(scope="module")
def hanging(make_arm):
    return make_arm(2).model_copy(update={"gravity_direction": (0.0, 0.0, 1.0)})


def session(arm, seed, size=1.0, payload=0.0):
    """Cables in proportion to the bend, and two ends; a payload straightens them."""
    random = np.random.default_rng(seed)
    bends = size * random.uniform(-0.6, 0.6, (ROWS, 2))
    cables = np.repeat(bends[:, None], arm.module_count, axis=1)
    shares = np.arange(1, arm.module_count + 1) / arm.module_count
    across = arm.length * shares[:, None] ** 2 * bends[:, None]
    # the load acts the more, the further from the base
    across = across * (1 - payload * shares[:, None])
    heights = arm.length * shares - 0.6 * (across**2).sum(axis=-1) / arm.length
    positions = np.concatenate([across, heights[..., None]], axis=-1)
    return cables, positions + random.normal(0, 2e-3, positions.shape)


def test_an_unchanged_session_is_no_alarm(hanging):
    change = find_change(*session(hanging, 1), *session(hanging, 0), hanging)
    assert not change.is_moved
    assert not change.is_payload
    assert "no camera has moved" in describe_change(change)


@pytest.mark.parametrize("tip_only", [False, True])
@pytest.mark.parametrize("axis", ["x", "z"])
def test_a_moved_camera_is_reported(hanging, axis, tip_only):
    cables, positions = session(hanging, 1)
    first_cables, first_positions = session(hanging, 0)
    turn = Rotation.from_euler(axis, 2.5, degrees=True).as_matrix()
    shift = np.array([0.0, 0.01, 0.0])
    for moved in (positions + shift, positions @ turn.T):
        places = moved.copy()
        if tip_only:
            places[:, 0] = np.nan
        change = find_change(cables, places, first_cables, first_positions, hanging)
        assert change.is_moved
        assert "without --like" in describe_change(change)


def test_a_payload_is_no_moved_camera(hanging):
    loaded = session(hanging, 1, payload=0.25)
    change = find_change(*loaded, *session(hanging, 0), hanging)
    assert not change.is_moved
    assert change.is_payload
    assert "consistent with a payload" in describe_change(change)


def test_larger_pulls_are_extrapolation(hanging):
    larger = session(hanging, 1, size=2.0)
    change = find_change(*larger, *session(hanging, 0), hanging)
    assert not change.is_moved
    assert change.extrapolated > 0.4
    assert "extrapolates" in describe_change(change)


def test_too_few_rows_say_nothing(hanging):
    cables, positions = session(hanging, 0)
    unknown = np.full_like(positions, np.nan)
    change = find_change(cables, unknown, cables, positions, hanging)
    assert change.rows == 0
    assert not change.is_moved
