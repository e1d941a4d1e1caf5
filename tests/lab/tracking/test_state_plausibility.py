"""States that an arm cannot have are rejected, and true ones never."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.kinematics.chain import states_from_bends
from s2c2a.lab.emulation.plant import Plant
from s2c2a.lab.tracking import TrackingError
from s2c2a.lab.tracking.plausibility import PERSISTENCE, StateCheck

PRESETS = ["simulated_arm", "twin_arm", "twin_both", "twin_capstan", "twin_creep"]
SERVO_PRESETS = PRESETS[1:]
LENGTHS = (0.2, 0.2, 0.2)
LIMITS = np.deg2rad([50.0, 50.0, 50.0])
UP = [0.0, 0.0, 1.0]


def straight():
    heights = np.cumsum(LENGTHS)
    return np.array([[0.0, 0.0, height, *UP] for height in heights])


@pytest.fixture
def check():
    """A check that has seen the straight arm."""
    seen = StateCheck(LENGTHS, LIMITS)
    checked = seen(straight(), 0.0)
    np.testing.assert_array_equal(checked.states, straight())
    assert checked.reasons == ("", "", "")
    return seen


def rejected(checked):
    missing = np.isnan(checked.states).all(axis=1)
    assert [bool(reason) for reason in checked.reasons] == missing.tolist()
    return [number + 1 for number in np.flatnonzero(missing)]


def sampled_states(geometry, count, seed=0):
    """States of arcs up to the bend limits, many at the limits or in one plane."""
    random = np.random.default_rng(seed)
    shape = (count, len(geometry.lengths))
    angles = random.uniform(0, 2 * np.pi, shape)
    angles[: count // 8] = angles[: count // 8, :1]
    bends = geometry.bend_limits * np.sqrt(random.uniform(0, 1, shape))
    bends[: count // 4] = geometry.bend_limits
    vectors = bends[..., None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return np.array(states_from_bends(vectors, geometry.lengths), dtype=float)


@pytest.mark.parametrize(("height", "is_plausible"), [(0.239, True), (0.241, False)])
def test_a_module_is_at_most_a_tenth_and_20_mm_longer(check, height, is_plausible):
    states = straight()
    states[0, 2] = height
    states[1:] = np.nan
    check.reset()
    reason = "" if is_plausible else "out of reach"
    assert check(states, 0.0).reasons[0] == reason


def test_swapped_distal_ends_are_both_rejected(check):
    checked = check(straight()[[0, 2, 1]], 0.0)
    assert {2, 3} <= set(rejected(checked))


def test_two_ends_at_one_place_contradict_each_other(check):
    states = straight()
    states[2, :3] = states[1, :3]
    checked = check(states, 0.0)
    assert 3 in rejected(checked)
    assert "does not fit module" in checked.reasons[2]


def tilted(angle):
    """The straight arm, turned about the base by an angle [rad]."""
    turn = Rotation.from_rotvec([0.0, angle, 0.0])
    return np.hstack([turn.apply(half) for half in np.hsplit(straight(), 2)])


def test_a_jump_is_rejected_until_it_persists(check):
    reasons = [
        check(tilted(0.6), 0.01 * frame).reasons for frame in range(1, PERSISTENCE + 2)
    ]
    # 0.6 rad at 0.2 m are 118 mm: more than 20 mm and 5 m/s, until 20 ms are over
    assert reasons[0] == ("jumped", "jumped", "jumped")
    assert {one[2] for one in reasons[: PERSISTENCE - 1]} == {"jumped"}
    assert reasons[-1] == ("", "", "")


def test_jumps_to_ever_other_places_never_persist(check):
    for frame in range(1, 20):
        angle = 0.6 if frame % 2 else -0.6
        assert check(tilted(angle), 0.001 * frame).reasons[2] == "jumped"


def test_a_place_out_of_reach_never_persists(check):
    states = straight()
    states[2, 2] = 0.9
    for frame in range(3 * PERSISTENCE):
        assert check(states, 0.01 * frame).reasons[2] == "out of reach"
    assert states[2, 2] == 0.9  # what was given stays as it is


def test_after_an_absence_an_end_may_be_elsewhere(check):
    missing = np.full((3, 6), np.nan)
    check(missing, 0.5)
    assert check(tilted(0.6), 1.0).reasons == ("", "", "")


def test_after_a_reset_every_place_is_new(check):
    check.reset()
    assert check(tilted(0.6), 0.001).reasons == ("", "", "")


@pytest.mark.parametrize("name", PRESETS)
def test_true_states_are_never_rejected(name):
    geometry = ArmGeometry.of(load_arm(name))
    check = StateCheck(geometry.lengths, geometry.bend_limits)
    noise = np.random.default_rng(1)
    for states in sampled_states(geometry, 2000):
        states[:, :3] += noise.normal(0.0, 0.003, (len(states), 3))
        check.reset()
        assert not any(check(states, 0.0).reasons)


@pytest.mark.slow
@pytest.mark.parametrize("payload", [0.0, 0.1])
@pytest.mark.parametrize("name", SERVO_PRESETS)
def test_violent_motions_are_never_rejected(name, payload):
    arm = load_arm(name)
    geometry = ArmGeometry.of(arm)
    plant = Plant(arm, "fast", 0, payload, homed=True)
    plant.targets.torque[:] = True
    plant.targets.speed[:] = 1.0
    plant.targets.tension[:] = 100.0
    check = StateCheck(geometry.lengths, geometry.bend_limits)
    random = np.random.default_rng(1)
    for step in range(400):
        if step % 60 == 0:
            shares = random.normal(size=(arm.module_count, 2))
            shares /= np.linalg.norm(shares, axis=1, keepdims=True)
            actions = geometry.actions_at(shares)
            low, high = geometry.action_low, geometry.action_high
            plant.targets.goal[:] = np.clip(actions, low, high).ravel()
        plant.advance()
        assert not any(check(plant.states(), plant.time).reasons)


@pytest.mark.parametrize("name", PRESETS)
def test_swapped_and_flipped_bodies_are_always_recognized(name):
    geometry = ArmGeometry.of(load_arm(name))
    check = StateCheck(geometry.lengths, geometry.bend_limits)
    for states in sampled_states(geometry, 500):
        check.reset()
        assert np.isnan(check(states[[1, 0, 2]], 0.0).states[:2]).all()
        states[1, 3:] *= -1
        check.reset()
        assert rejected(check(states, 0.0)) == [2]


@pytest.mark.parametrize(
    "options",
    [
        {"lengths": (), "bend_limits": ()},
        {"lengths": (0.2, -0.1), "bend_limits": (1.0, 1.0)},
        {"lengths": (0.2,), "bend_limits": (1.0, 1.0)},
        {"lengths": (0.2,), "bend_limits": (0.0,)},
        {"lengths": (0.2,), "bend_limits": (float("nan"),)},
    ],
)
def test_invalid_options_are_refused(options):
    with pytest.raises(TrackingError, match="give"):
        StateCheck(**options)
