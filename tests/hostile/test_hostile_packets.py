"""Random and damaged packets at every reader of a pose tracker, 3000 each.

`python tests/hostile/hostile_packets.py --count 100000` reads more.
"""

import pytest
from hostile_packets import BAD, POSES, READERS, judge, outcome, read_all

COUNT = 3000


@pytest.mark.parametrize("name", READERS)
def test_a_damaged_packet_raises_our_error_or_has_plausible_poses(name):
    counts, bad, _ = read_all(name, COUNT, seed=1)
    assert counts.total() == COUNT
    assert not any(counts[ending] for ending in BAD), bad
    assert counts["our error"] > COUNT / 4


@pytest.mark.parametrize("name", READERS)
def test_an_undamaged_packet_has_the_poses_that_were_sent(name):
    reader = READERS[name]
    tracker = reader.read(reader.sources[0])
    assert sorted(tracker.latest().poses) == sorted(POSES)
    assert judge(tracker, may_differ=False) == "unchanged"
    assert outcome(reader, reader.sources[0], may_differ=False) == "unchanged"
