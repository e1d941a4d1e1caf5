"""The warning that a path lies outside the training data."""

import numpy as np
import pytest

from made_up import made_up
from s2c2a.episodes import Episode
from s2c2a.evaluation import describe_extrapolation, is_outside_data

NEAR = 0.003  # m; standard deviation near the data
STEPS = 20


def run(extrapolation, **columns) -> Episode:
    """A run of 20 steps whose uncertainty is `NEAR` without extrapolation [m]."""
    std = np.zeros((STEPS, 3))
    std[:, -1] = np.hypot(NEAR, extrapolation)
    return made_up(STEPS, predictive_std=std, extrapolation=extrapolation, **columns)


def far_in(*steps) -> np.ndarray:
    extrapolation = np.full(STEPS, 0.5 * NEAR)
    extrapolation[list(steps)] = 2.0 * NEAR
    return extrapolation


def test_a_plan_is_outside_the_data_where_most_variance_is_extrapolation():
    extrapolation = NEAR * np.array([0.0, 0.99, 1.01, 5.0])
    std = np.hypot(NEAR, extrapolation)[:, None]
    assert is_outside_data(std, extrapolation).tolist() == [False, False, True, True]


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_a_model_without_uncertainty_is_never_outside_its_data(value):
    assert not is_outside_data(np.full((4, 3), value), np.full(4, value)).any()


def test_the_warning_says_where_the_path_leaves_the_data_and_what_to_record():
    predicted = np.zeros((STEPS, 3, 6))
    predicted[:, -1, :3] = [0.2, -0.1, 0.4]
    episode = run(far_in(5, 6, 7, 12), predicted=predicted)
    assert describe_extrapolation(episode) == (
        "the path lies outside the training data in 4 of 20 steps, first from 0.6 to "
        "0.8 s near (20, -10, 40) cm; record more episodes, or choose a smaller path "
        "(a slower pace does not help)"
    )


def test_a_path_that_ends_outside_the_data_is_reported_up_to_its_end():
    episode = run(far_in(*range(10, STEPS)))
    assert "in 10 of 20 steps, first from 1.1 to 1.9 s;" in (
        describe_extrapolation(episode)
    )


def test_a_tenth_of_a_path_outside_the_data_is_not_worth_a_warning():
    assert describe_extrapolation(run(far_in(3, 4))) == ""
    assert describe_extrapolation(made_up(1)) == ""
