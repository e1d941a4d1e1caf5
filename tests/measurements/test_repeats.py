"""A measurement is new unless it equals the last one to the last bit."""

import numpy as np

from s2c2a.measurements.repeats import RepeatDetector, repeated_rows


def test_rows_and_readings_repeat_alike():
    """To the last bit; numbers that are missing in both rows are equal."""
    last = np.nextafter(0.2, 1.0)
    values = [[0.1, 0.2], [0.1, 0.2], [0.1, last], [0.1, 0.2], [0.1, np.nan]]
    values = np.array([*values, [0.1, np.nan], [0.1, 2.0]])
    detector = RepeatDetector()
    assert not detector.is_repeated("flex", values[0])
    live = [detector.is_repeated("states", row) for row in values]
    np.testing.assert_array_equal(repeated_rows(values), live)
    assert live == [False, True, False, False, False, True, False]


def test_no_row_repeats_nothing():
    assert not len(repeated_rows(np.zeros((0, 3))))
