"""A measurement is new unless it equals the last one to the last bit."""

import numpy as np

from s2c2a.measurements.repeats import RepeatDetector, repeated_rows


def test_rows_and_readings_repeat_alike():
    values = np.array([[0.1, 0.2], [0.1, 0.2], [0.1, 0.3], [0.1, 0.2]])
    detector = RepeatDetector()
    live = [detector.is_repeated("states", row) for row in values]
    np.testing.assert_array_equal(repeated_rows(values), live)
    assert live == [False, True, False, False]


def test_numbers_that_are_missing_in_both_rows_are_equal():
    values = np.array([[1.0, np.nan], [1.0, np.nan], [1.0, 2.0]])
    np.testing.assert_array_equal(repeated_rows(values), [False, True, False])


def test_no_row_repeats_nothing():
    assert not len(repeated_rows(np.zeros((0, 3))))
