"""Drawn plans beside a long search."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.kinematics import PCCForwardModel
from s2c2a.planning import BEST, NO_FALLBACK, LeastSquares, Pull, FallbackSearch
from s2c2a.studies import plans as studied
from s2c2a.studies.plans import KINDS, Held, drawn, held_against_long_search

TWIN = load_arm("twin_arm")
MODEL = PCCForwardModel.of(TWIN)


@pytest.fixture(scope="module", autouse=True)
def small():
    """A short search, and few plans at once."""
    with pytest.MonkeyPatch.context() as patched:
        for name, number in {
            "CHUNK": 8,
            "STARTS": 4,
            "ITERATIONS": 8,
            "SETTLING": 20,
        }.items():
            patched.setattr(studied, name, number)
        yield


def test_a_seed_draws_the_same_problems_and_every_kind_of_goal():
    first, again, other = (drawn(TWIN, MODEL, 8, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.walks, again.walks)
    assert np.abs(first.walks - other.walks).max() > 0.1
    asked = np.stack(
        [first.goals.position_weights.sum(-1), first.goals.axis_weights.sum(-1)],
        axis=-1,
    )
    assert dict(zip(KINDS, asked.tolist(), strict=False)) == {
        "tip": [1, 0], "tip and axis": [1, 2], "middle and tip": [5, 0], "anywhere": [1, 0],
    }  # fmt: skip


def test_plans_are_good_that_come_near_the_long_search_or_move_by_a_whole_step():
    held = Held(
        np.array([1.0, 1.2, 1.2, 1e-5]),
        np.array([0.99, 1.0, 1.0, 1e-6]),
        np.array([0, 0, 1, 0], bool),
    )
    assert held.good.tolist() == [True, False, True, False]
    assert held.standing.tolist() == [False, True, False, False]


def test_most_plans_come_near_the_long_search_and_few_of_one_iteration_do():
    share = {}
    for solver, fallback in (
        (LeastSquares(), FallbackSearch()),
        (LeastSquares(1), NO_FALLBACK),
    ):
        options = replace(BEST, solver=solver, guides=(Pull(),), fallback=fallback)
        held = held_against_long_search(TWIN, MODEL, options, 16)
        assert all(
            np.isfinite(held[when].cost).all() for when in ("one step", "settled")
        )
        share[solver.iterations] = held["settled"].good.mean()
    assert share[20] > 0.8 > share[1]
