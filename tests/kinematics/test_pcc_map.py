import jax
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import cable_layouts
from cable_layouts import even, layouts
from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.kinematics import PCC, configurations_from_bends

RADIUS = 0.027
FULL = np.deg2rad(60.0)
quick = settings(deadline=None, max_examples=30)
small_displacements = st.floats(-0.02, 0.02)
directions = st.floats(-np.pi, np.pi)
kinds = st.sampled_from(["displacement", "tension"])

_bends = jax.jit(lambda pcc, actions: pcc.bends(actions))
_actions = jax.jit(lambda pcc, bends: pcc.actions(bends))
_configurations = jax.jit(configurations_from_bends)


def bends_held_by(arm, actions):
    return np.asarray(_bends(PCC.of(arm), np.asarray(actions, np.float32)))


def actions_for(arm, bends):
    return np.asarray(_actions(PCC.of(arm), np.asarray(bends, np.float32)))


def configurations_held_by(arm, actions):
    return np.asarray(_configurations(bends_held_by(arm, actions)))


def arm_of(angles, actuation="displacement", radius=RADIUS):
    """So soft that no tension reaches its limit within the full bend."""
    values = {"bend_limit_deg": 60.0, "pretension": 400.0, "tension_range": 500.0}
    return cable_layouts.arm_of(angles, actuation, cable_radius=radius, **values)


def paper_configuration(a):
    """Eqs. (2) and (3) as printed."""
    phi = np.sqrt(a[0] ** 2 + (a[1] - a[2]) ** 2 / 3) / RADIUS
    theta = np.arctan2(-a[0], (a[1] - a[2]) / np.sqrt(3))
    return np.array([*polar(np.sin(phi), theta - np.pi / 2), np.cos(phi)])


def polar(angle, direction):
    return np.array([angle * np.cos(direction), angle * np.sin(direction)])


@quick
@given(small_displacements, small_displacements)
def test_three_cables_follow_equations_2_and_3(first, second):
    displacements = np.array([first, second, -first - second])  # eq. (1)
    found = configurations_held_by(arm_of(even(3)), [displacements])[0]
    np.testing.assert_allclose(found, paper_configuration(displacements), atol=2e-6)


def test_shortening_the_first_cable_bends_towards_it():
    displacements = RADIUS * 0.5 * np.array([-1.0, 0.5, 0.5])
    found = bends_held_by(arm_of(even(3)), [displacements])
    np.testing.assert_allclose(found, [[0.5, 0.0]], atol=1e-6)


@quick
@given(small_displacements, small_displacements)
def test_module_ii_of_the_twin_stands_turned_by_60_degrees(first, second):
    displacements = np.array([first, second, -first - second])
    found = configurations_held_by(load_arm("twin_arm"), np.tile(displacements, (3, 1)))
    x, y, z = paper_configuration(displacements)
    turned = [x / 2 - y * np.sqrt(3) / 2, x * np.sqrt(3) / 2 + y / 2, z]
    np.testing.assert_allclose(found, [[x, y, z], turned, [x, y, z]], atol=2e-6)


@quick
@given(st.floats(0, FULL), directions, st.integers(3, 8), st.floats(-180, 180))
def test_evenly_spread_displacements_keep_the_length_of_the_module(
    angle, direction, cables, offset
):
    """Eq. (1) for any number of cables."""
    displacements = actions_for(arm_of(even(cables, offset)), [polar(angle, direction)])
    assert displacements.sum() == pytest.approx(0.0, abs=1e-7)


@quick
@given(layouts(), st.floats(0, 0.99 * FULL), directions)
def test_displacements_come_back_as_their_bend_for_any_cables(angles, angle, direction):
    arm, bend = arm_of(angles), polar(angle, direction)
    displacements = actions_for(arm, [bend])
    by_hand = -RADIUS * angle * np.cos(direction - np.deg2rad(angles))
    np.testing.assert_allclose(displacements[0], by_hand, atol=1e-7)
    np.testing.assert_allclose(bends_held_by(arm, displacements)[0], bend, atol=2e-6)


@quick
@given(layouts(), st.floats(0, 0.99 * FULL), directions)
def test_tensions_come_back_as_their_bend_for_any_cables(angles, angle, direction):
    arm, bend = arm_of(angles, "tension"), polar(angle, direction)
    assume(ArmGeometry.of(arm).action_neutral.min() > 100)  # else a cable goes slack
    found = bends_held_by(arm, actions_for(arm, [bend]))
    np.testing.assert_allclose(found[0], bend, atol=2e-4)


@quick
@given(st.integers(3, 8), st.floats(-180, 180), st.floats(0, 0.99 * FULL), directions)
def test_tensions_hold_the_module_against_its_stiffness(
    cables, offset, angle, direction
):
    """The protocol's T_i = T0 + 2 EI f cos(psi - b_i) / (n r L)."""
    angles = even(cables, offset)
    pull = 2 * 0.16 * angle / (cables * RADIUS * 0.2)
    by_hand = 400 + pull * np.cos(direction - np.deg2rad(angles))
    tensions = actions_for(arm_of(angles, "tension"), [polar(angle, direction)])
    np.testing.assert_allclose(tensions[0], by_hand, rtol=1e-6)


@quick
@given(st.integers(3, 8), st.floats(-180, 180), kinds)
def test_common_motion_of_evenly_spread_cables_has_no_effect(cables, offset, actuation):
    arm = arm_of(even(cables, offset), actuation)
    actions = actions_for(arm, [[0.3, -0.4]])
    common = {"displacement": 0.005, "tension": 5.0}[actuation]
    found = bends_held_by(arm, actions + common)
    np.testing.assert_allclose(found, [[0.3, -0.4]], atol=2e-4)


@quick
@given(layouts(), st.floats(0, 100), directions, kinds)
def test_actions_for_any_bend_stay_within_the_limits(
    angles, angle, direction, actuation
):
    arm = arm_of(angles, actuation)
    geometry = ArmGeometry.of(arm)
    actions = actions_for(arm, [polar(angle, direction)])
    assert (actions >= geometry.action_low - 1e-4).all()
    assert (actions <= geometry.action_high + 1e-4).all()


def test_every_module_has_its_own_radius_and_cables():
    arm, other = arm_of(even(3), radius=0.01), arm_of((60, 300, 180), radius=0.02)
    arm = arm.model_copy(update={"modules": arm.modules + other.modules})
    displacements = [[-0.005, 0.0025, 0.0025], [-0.005, -0.005, 0.01]]
    found = actions_for(arm, [[0.5, 0.0], [0.5, 0.0]])
    np.testing.assert_allclose(found, displacements, atol=1e-8)


@pytest.mark.parametrize("batch", [(5,), (2, 3)])
def test_a_batch_of_actions_is_its_members_one_by_one(batch):
    arm = load_arm("twin_arm")
    actions = np.random.default_rng(1).uniform(-0.01, 0.01, (*batch, 3, 3))
    bends = bends_held_by(arm, actions)
    assert bends.shape == (*batch, 3, 2)
    alone = [bends_held_by(arm, one) for one in actions.reshape(-1, 3, 3)]
    np.testing.assert_allclose(bends.reshape(-1, 3, 2), alone, atol=1e-6)
    back = [actions_for(arm, one) for one in bends.reshape(-1, 3, 2)]
    found = actions_for(arm, bends).reshape(-1, 3, 3)
    np.testing.assert_allclose(found, back, atol=1e-8)
