"""Exposure times on this computer's clock."""

import numpy as np
import pytest

from s2c2a.lab.tracking.clock import WINDOW, ExposureClock

PERIOD = 0.01  # s


def test_the_fastest_frames_are_as_old_as_the_latency():
    clock = ExposureClock(latency=0.02)
    assert clock.exposure(105.0, 5.0) == pytest.approx(104.98)
    assert clock.exposure(105.01, 5.01) == pytest.approx(104.99)


def test_a_frame_that_comes_late_is_older_by_its_delay():
    clock = ExposureClock()
    clock.exposure(100.0, 0.0)
    assert clock.exposure(100.35, 0.05) == pytest.approx(100.05)


@pytest.mark.parametrize("drift", [-50e-6, 50e-6])
def test_a_clock_that_drifts_costs_a_millisecond_at_most(drift):
    clock = ExposureClock()
    errors = []
    for exposure in np.arange(0.0, 100.0, PERIOD):
        found = clock.exposure(exposure, (1 + drift) * exposure)
        errors.append(found - exposure)
    assert np.abs(errors).max() <= abs(drift) * 2 * WINDOW * 1.01


def test_a_source_whose_clock_stands_still_makes_frames_old():
    clock = ExposureClock()
    clock.exposure(0.0, 7.0)
    assert clock.exposure(3.0, 7.0) == pytest.approx(0.0)


def test_a_clock_that_begins_again_has_another_offset():
    clock = ExposureClock()
    clock.exposure(100.0, 50.0)
    assert clock.exposure(110.0, 0.0) == pytest.approx(110.0)
