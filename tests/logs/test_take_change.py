"""A moved camera, homed motors, a payload and larger pulls are told apart."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from s2c2a.kinematics.chain import states_from_bends
from s2c2a.logs.take_change import describe_change, find_change

from marks import slow_after

ROWS = 400


@pytest.fixture(scope="module")
def hanging(make_arm):
    return make_arm(2).model_copy(update={"gravity_direction": (0.0, 0.0, 1.0)})


def take(arm, seed, size=1.0, payload=0.0):
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


@pytest.mark.parametrize("tip_only", slow_after(1, [True, False]))
@pytest.mark.parametrize("axis", slow_after(1, ["x", "z"]))
def test_a_moved_camera_is_reported(hanging, axis, tip_only):
    cables, positions = take(hanging, 1)
    first = take(hanging, 0)
    turn = Rotation.from_euler(axis, 2.5, degrees=True).as_matrix()
    shift = np.array([0.0, 0.01, 0.0])
    for moved in (positions + shift, positions @ turn.T):
        if tip_only:
            moved[:, 0] = np.nan
        change = find_change(cables, moved, *first, hanging)
        assert change.is_moved
        assert "without --like" in describe_change(change)


def test_cameras_that_were_put_up_anew_are_named_with_what_they_moved_by(hanging):
    cables, positions = take(hanging, 1)
    turn = Rotation.from_rotvec(np.deg2rad([10.0, 35.0, -15.0]))
    shift = np.array([0.4, -0.3, 0.3])
    moved = turn.apply(positions.reshape(-1, 3)).reshape(positions.shape) + shift
    change = find_change(cables, moved, *take(hanging, 0), hanging)
    assert change.is_moved
    assert not change.may_be_homing
    np.testing.assert_allclose(change.shift, shift, atol=5e-3)
    np.testing.assert_allclose(change.rotation, turn.as_rotvec(), atol=0.02)


def test_a_payload_is_no_moved_camera(hanging):
    change = find_change(*take(hanging, 1, payload=0.25), *take(hanging, 0), hanging)
    assert not change.is_moved
    assert change.is_payload
    assert "consistent with a payload" in describe_change(change)


def test_larger_pulls_are_extrapolation(hanging):
    change = find_change(*take(hanging, 1, size=2.0), *take(hanging, 0), hanging)
    assert not change.is_moved
    assert change.extrapolated > 0.4
    assert "extrapolates" in describe_change(change)


def test_too_few_rows_say_nothing(hanging):
    cables, positions = take(hanging, 0)
    few = cables[:2], positions[:2]
    many = [np.repeat(values, 40, axis=0) for values in few]
    assert find_change(*many, *few, hanging) is None
    unknown = np.full_like(positions, np.nan)
    assert find_change(cables, unknown, cables, positions, hanging) is None


def arcs(arm, seed, offsets=0.0, size=1.0):
    """Every module bends by its own cables, whose zeros are off by some bends [rad]."""
    random = np.random.default_rng(seed)
    cables = random.uniform(-0.7, 0.7, (4 * ROWS, arm.module_count, 2))
    lengths = np.full(arm.module_count, arm.length / arm.module_count)
    states = np.array(states_from_bends(size * cables + offsets, lengths), float)
    return cables, states[..., :3] + random.normal(0, 2e-3, states[..., :3].shape)


def test_homed_motors_are_no_moved_camera(hanging):
    offsets = np.array([[0.0, 0.0], [0.15, -0.1]])
    change = find_change(*arcs(hanging, 1, offsets), *arcs(hanging, 0), hanging)
    assert change.may_be_homing
    assert not change.is_moved
    text = describe_change(change)
    assert text.startswith("motors were homed anew")
    assert "without --like" in text


def test_of_homed_motors_of_the_first_module_both_causes_are_named(hanging):
    """A bend of the first module turns all ends about its middle, as a camera may."""
    offsets = np.array([[0.15, -0.1], [0.0, 0.0]])
    change = find_change(*arcs(hanging, 1, offsets), *arcs(hanging, 0), hanging)
    text = describe_change(change)
    assert text.startswith("a camera or the base has moved")
    assert "or motors were homed anew" in text
    assert "the data cannot tell" in text


@pytest.mark.parametrize("shift", [(0.03, 0.0, 0.0), (0.0, 0.01, 0.03)])
def test_a_moved_camera_is_no_homing(hanging, shift):
    cables, positions = arcs(hanging, 1)
    change = find_change(cables, positions + shift, *arcs(hanging, 0), hanging)
    assert change.is_moved
    assert not change.may_be_homing
    assert describe_change(change).startswith("a camera or the base has moved")


def test_of_a_nearly_straight_arm_both_causes_are_named(hanging):
    """Small bends of one module turn its end as a camera does."""
    offsets = np.array([[0.1, 0.0], [0.0, 0.0]])
    later = arcs(hanging, 1, offsets, size=0.1)
    change = find_change(*later, *arcs(hanging, 0, size=0.1), hanging)
    assert "the data cannot tell" in describe_change(change)


@pytest.mark.parametrize("made", [take, arcs])
def test_an_unchanged_take_is_no_alarm(hanging, made):
    change = find_change(*made(hanging, 1), *made(hanging, 0), hanging)
    assert not change.is_moved
    assert not change.is_payload
    assert "no camera has moved" in describe_change(change)
