"""Plans compared with a long multi-start search."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import BEST
from s2c2a_experiments import plans as studied
from s2c2a_experiments.plans import (
    KINDS,
    Comparison,
    compare_with_long_search,
    sample_problems,
)

TWIN = load_arm("twin_arm")
MODEL = PCCForwardModel.of(TWIN)


@pytest.fixture(scope="module", autouse=True)
def small():
    """A short search and small chunks."""
    with pytest.MonkeyPatch.context() as patched:
        for name, number in {
            "CHUNK": 8,
            "STARTS": 4,
            "ITERATIONS": 8,
            "SETTLING": 150,
        }.items():
            patched.setattr(studied, name, number)
        yield


@pytest.mark.slow
def test_a_seed_gives_the_same_problems_and_every_kind_of_goal():
    first, again, other = (sample_problems(TWIN, MODEL, 8, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.histories, again.histories)
    assert np.abs(first.histories - other.histories).max() > 0.1
    weights = np.stack(
        [first.goals.position_weights.sum(-1), first.goals.axis_weights.sum(-1)],
        axis=-1,
    )
    assert dict(zip(KINDS, weights.tolist(), strict=False)) == {
        "tip": [1, 0],
        "tip and axis": [1, 2],
        "middle and tip": [5, 0],
        "anywhere": [1, 0],
    }


def test_a_plan_is_optimal_near_the_long_search_or_at_the_step_limit():
    comparison = Comparison(
        np.array([1.0, 1.2, 1.2, 1e-5]),
        np.array([0.99, 1.0, 1.0, 1e-6]),
        np.array([0, 0, 1, 0], bool),
    )
    assert comparison.optimal.tolist() == [True, False, True, False]
    assert comparison.stuck.tolist() == [False, True, False, False]


@pytest.mark.slow
def test_most_plans_are_optimal():
    options = replace(BEST, guides=())
    comparisons = compare_with_long_search(TWIN, MODEL, options, 8)
    assert all(
        np.isfinite(comparisons[when].cost).all() for when in ("one step", "settled")
    )
    assert comparisons["settled"].optimal.mean() > 0.8
