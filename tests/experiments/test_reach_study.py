"""A small version of the comparison of reachability with a long search."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a_experiments import reach
from s2c2a_experiments.reach import KINDS, Poses, ReachStudy, compared, reach_rows

TWIN = load_arm("twin_arm")
ARCS = PCCForwardModel.of(TWIN)


@pytest.fixture(scope="module", autouse=True)
def short():
    """A search that takes seconds."""
    with pytest.MonkeyPatch.context() as patched:
        for name, number in {"STARTS": 24, "ITERATIONS": 20, "SIDE_BY_SIDE": 6}.items():
            patched.setattr(reach, name, number)
        yield


def test_a_seed_gives_the_same_poses_of_every_kind():
    first, again, other = (Poses.drawn(TWIN, ARCS, 12, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.goals.positions, again.goals.positions)
    assert np.abs(first.goals.positions - other.goals.positions).max() > 0.1
    assert {kind: (first.kinds == kind).sum() for kind in KINDS} == dict.fromkeys(
        KINDS, 4
    )
    has_axis = first.goals.axis_weights[:, -1] > 0.0
    np.testing.assert_array_equal(has_axis, first.kinds == "position and axis")
    counts = (first.goals.thresholds > 0.0).sum(axis=1)
    assert counts[~first.are_beside].max() == 0
    assert 1 <= counts[first.are_beside].max() <= 8


@pytest.mark.slow
def test_both_searches_agree_on_most_poses():
    comparison = compared(TWIN, ARCS, 18, 0)
    assert np.mean(comparison.within == comparison.within_long) >= 0.8
    is_plain = ~comparison.poses.are_beside
    is_reachable = is_plain & (comparison.poses.kinds == "within reach")
    assert comparison.within_long[is_reachable].all()
    assert np.median(np.abs(comparison.farther)) < 1e-3
    assert min(comparison.time, comparison.long_time) > 0.0


def test_rows_name_the_model_of_every_arm(monkeypatch):
    class Networks:
        c2s = ARCS

    def no_search(arm, model, count, seed):
        poses = Poses.drawn(arm, model, count, seed)
        reached = np.arange(count) % 2 == 0
        none = np.zeros(count)
        return reach.ReachComparison(
            poses, reached, ~none.astype(bool), none, 0.001, 0.1
        )

    monkeypatch.setattr(reach, "compared", no_search)
    other = TWIN.model_copy(update={"name": "other"})
    study = ReachStudy((TWIN, other), poses=12)
    rows = reach_rows(study, lambda artifacts: [Networks() for _ in artifacts])
    models = {row.arm: row.strategy for row in rows}
    assert models == {"twin_arm": "trained networks", "other": "arcs"}
    shares = [row.mean for row in rows if row.metric == "verdicts agree"]
    assert shares[0] == 0.5
    times = {row.mean for row in rows if row.metric == "time"}
    assert times == {1.0}
