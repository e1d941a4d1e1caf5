"""Jumps of all ends at once, and motions of the arm that are none."""

import numpy as np
import pytest

from s2c2a.kinematics.chain import states_from_bends
from s2c2a.lab.tracking.frame_jumps import FrameJumps
from s2c2a.measurements.frame_jumps import find_frame_jumps

LENGTHS = np.array([0.2, 0.2, 0.2])
ROWS = 200
TIMES = 0.05 * np.arange(ROWS)
SHIFT = np.array([0.004, 0.003, 0.003])  # m; 5.8 mm


def moving(speed, seed=0):
    """An arm that follows smooth random bends at some speed [rad/s], and noise."""
    random = np.random.default_rng(seed)
    rates = random.uniform(0.3, 1.0, (2, 3, 2)) * speed / 0.4
    phases = random.uniform(0, 6, (2, 3, 2))
    waves = np.sin(rates * TIMES[:, None, None, None] + phases)
    states = np.array(states_from_bends(0.2 * waves.sum(axis=1), LENGTHS), float)
    states[..., :3] += random.normal(0, 3e-4, (ROWS, 3, 3))
    return states


def find(states):
    return find_frame_jumps(states, TIMES, LENGTHS.sum())


@pytest.mark.parametrize("speed", [0.0, 0.1, 0.3])
def test_a_jump_at_rest_and_in_slow_motion_is_found(speed):
    states = moving(speed)
    states[100:, :, :3] += SHIFT
    jumps = find(states)
    assert list(jumps) == [100]
    np.testing.assert_allclose(jumps[100], SHIFT, atol=1.5e-3)


@pytest.mark.parametrize("speed", [0.0, 0.3, 1.0, 3.0])
def test_motion_is_no_jump(speed):
    assert all(not find(moving(speed, seed)) for seed in range(5))


@pytest.mark.parametrize("noise", [3e-4, 1e-3, 3e-3])
def test_noise_of_the_base_is_no_jump(noise):
    states = moving(0.0)
    states[..., :3] += np.random.default_rng(1).normal(0, noise, (ROWS, 1, 3))
    assert not find(states)


def test_a_sudden_bend_is_no_jump():
    for module in range(3):
        bends = np.zeros((ROWS, 3, 2))
        bends[100:, module, 0] = 0.1
        assert not find(np.array(states_from_bends(bends, LENGTHS), float))


def test_a_jump_of_one_end_is_no_jump_of_the_frame():
    states = moving(0.0)
    states[100:, 1, :3] += SHIFT
    assert not find(states)


def test_lost_ends_do_not_hide_a_jump_of_the_others():
    states = moving(0.0)
    states[100:, :, :3] += SHIFT
    states[:, 0] = np.nan
    assert list(find(states)) == [100]
    states[:, 1] = np.nan
    assert not find(states)


def test_frames_one_by_one_find_the_same_once():
    states = moving(0.1)
    states[100:, :, :3] += SHIFT
    jumps = FrameJumps(LENGTHS.sum())
    found = [jumps.find(states[row], TIMES[row]) is not None for row in range(ROWS)]
    assert np.flatnonzero(found).tolist() == [102]
