"""Completion of partly observed states."""

import numpy as np

from s2c2a.kinematics import states_from_bends
from s2c2a.live.reconstruction import completed

LENGTHS = np.full(3, 0.2)
ARC = np.asarray(states_from_bends(np.tile([0.2, 0.3], (3, 1)), LENGTHS), float)


def test_the_tip_position_determines_a_circular_arc():
    known = np.full((3, 6), np.nan)
    known[2, :3] = ARC[2, :3]
    np.testing.assert_allclose(completed(known, LENGTHS), ARC, atol=1e-6)


def test_known_ends_stay_and_the_arm_is_straight_beyond_them():
    known = np.full((3, 6), np.nan)
    known[0] = [0.0, 0.0, 0.2, 0.0, 0.6, 0.8]
    states = completed(known, LENGTHS)
    np.testing.assert_array_equal(states[0], known[0])
    np.testing.assert_allclose(states[2], [0.0, 0.24, 0.52, 0.0, 0.6, 0.8])


def test_complete_states_stay_unchanged():
    np.testing.assert_array_equal(completed(ARC, LENGTHS), ARC)
