"""A frame that jumps or drifts within a log is reported; hysteresis is not."""

import numpy as np
import pytest

from s2c2a.logs.frame_motion import find_frame_motion

ROWS = 1500
SHIFT = np.array([4.5, 3.5, -1.0]) * 1e-3  # m, 5.8 mm


@pytest.fixture
def log():
    """Drives in random order, and two ends with 4 mm of slow errors."""
    random = np.random.default_rng(0)
    drives = random.uniform(-1, 1, (ROWS, 2))
    positions = np.zeros((ROWS, 2, 3))
    positions[..., :2] = drives[:, None] * np.array([0.03, 0.1])[:, None]
    positions[..., 2] = np.array([0.1, 0.2])
    slow = np.sin(np.arange(ROWS) / 15.0)
    positions[..., 0] += 4e-3 * slow[:, None]
    return drives, positions, 0.5 * np.arange(ROWS)


def test_a_steady_frame_is_not_reported(log):
    assert find_frame_motion(*log) is None


@pytest.mark.parametrize("seed", range(3))
def test_errors_that_last_as_long_as_a_few_motions_are_not_reported(seed):
    random = np.random.default_rng(seed)
    count = 500
    drives = np.cumsum(random.normal(size=(count, 2)), axis=0) / np.sqrt(count)
    errors = np.convolve(random.normal(size=count + 39), np.ones(40) / 40, "valid")
    positions = np.zeros((count, 1, 3))
    positions[:, 0, :2] = 0.1 * drives
    positions[:, 0, 0] += 5e-3 * errors
    assert find_frame_motion(drives, positions, 0.1 * np.arange(count)) is None


@pytest.mark.slow
def test_a_jump_is_reported_with_time_and_size(log):
    drives, positions, time = log
    positions[ROWS // 2 :] += SHIFT
    motion = find_frame_motion(drives, positions, time)
    assert motion.text.startswith("all ends jump by 5.")
    assert "about row 750 (375.0 s)" in motion.text
    assert motion.row == 750


@pytest.mark.slow
def test_a_drift_is_reported_with_its_size(log):
    drives, positions, time = log
    positions += np.linspace(0, 2, ROWS)[:, None, None] * SHIFT
    assert (
        "all ends drift by about 1" in find_frame_motion(drives, positions, time).text
    )


def test_a_short_log_is_not_judged(log):
    drives, positions, time = log
    assert find_frame_motion(drives[:30], positions[:30], time[:30]) is None
