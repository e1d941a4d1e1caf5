"""Percent of full range, worked by hand."""

import numpy as np
import pytest

from s2c2a.training.trained import full_ranges, percent_error


def test_each_output_is_divided_by_its_own_full_range():
    """Errors of 10, 20, 75, 0 % of the range: mean 26.25, deviation 29.02."""
    true = np.array([[[5.0, 1.0]], [[7.0, 2.0]]])
    predicted = np.array([[[6.0, -2.0]], [[5.0, 2.0]]])
    mean, spread = percent_error(predicted, true, np.array([[10.0, 4.0]]))
    assert mean == pytest.approx(26.25)
    assert spread == pytest.approx(np.std([10, 20, 75, 0]))


def test_full_range_is_the_largest_minus_the_smallest_value():
    values = np.array([[[1.0, 5.0]], [[-2.0, 5.5]], [[0.0, 5.25]]])
    np.testing.assert_array_equal(full_ranges(values), [[3.0, 0.5]])


def test_a_constant_output_has_range_one():
    np.testing.assert_array_equal(full_ranges(np.full((4, 1, 2), 7.0)), [[1.0, 1.0]])
