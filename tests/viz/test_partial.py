"""Arms of which only a part was seen are drawn whole: what was seen stays, arcs join it."""

import numpy as np

from s2c2a.kinematics import states_from_bends
from s2c2a.viz.reconstruction import completed

LENGTHS = np.full(3, 0.2)
ARC = np.asarray(states_from_bends(np.tile([0.2, 0.3], (3, 1)), LENGTHS), float)


def test_of_an_arc_the_tip_alone_tells_all():
    seen = np.full((3, 6), np.nan)
    seen[2, :3] = ARC[2, :3]
    np.testing.assert_allclose(completed(seen, LENGTHS), ARC, atol=1e-6)


def test_what_was_seen_stays_and_the_rest_goes_straight_on():
    seen = np.full((3, 6), np.nan)
    seen[0] = [0.0, 0.0, 0.2, 0.0, 0.6, 0.8]
    found = completed(seen, LENGTHS)
    np.testing.assert_array_equal(found[0], seen[0])
    np.testing.assert_allclose(found[2], [0.0, 0.24, 0.52, 0.0, 0.6, 0.8])


def test_all_that_was_seen_is_left_as_it_is():
    np.testing.assert_array_equal(completed(ARC, LENGTHS), ARC)
