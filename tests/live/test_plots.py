"""Live plots leave out what is not known."""

import numpy as np
import pytest

from s2c2a.live.plots import latest_stretch

NAN = np.nan


@pytest.mark.parametrize(
    ("values", "shown"),
    [
        ([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]),
        ([1.0, 2.0, NAN], [1.0, 2.0]),
        ([1.0, NAN, 3.0, 4.0], [3.0, 4.0]),
        ([1.0, NAN, 3.0, np.inf], [3.0]),
        ([NAN, NAN], []),
    ],
)
def test_a_chart_shows_the_last_values_without_a_gap(values, shown):
    lines = np.array([values])
    assert lines[0, latest_stretch(lines)].tolist() == shown
