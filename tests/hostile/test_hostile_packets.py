"""Random and damaged packets at every reader of a pose tracker, 300 or 3000 each."""

import pytest
from hostile_packets import BAD, POSES, READERS, judge, outcome, read_all

from marks import slow_after


@pytest.mark.parametrize("count", slow_after(1, [300, 3000]))
@pytest.mark.parametrize("name", READERS)
def test_a_damaged_packet_raises_our_error_or_has_plausible_poses(name, count):
    counts, bad = read_all(name, count, seed=1)
    assert counts.total() == count
    assert not any(counts[ending] for ending in BAD), bad
    assert counts["our error"] > count / 4


@pytest.mark.parametrize("name", READERS)
def test_an_undamaged_packet_has_the_poses_that_were_sent(name):
    reader = READERS[name]
    tracker = reader.read(reader.sources[0])
    assert sorted(tracker.latest().poses) == sorted(POSES)
    assert judge(tracker, may_differ=False) == "unchanged"
    assert outcome(reader, reader.sources[0], may_differ=False) == "unchanged"
