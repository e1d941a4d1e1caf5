"""Outliers of measured module ends: jumps, swaps and lengths, without false alarms."""

import numpy as np
import pytest

from s2c2a.measurements.outliers import MAX_SHARE, MeasuredEnds, find_outliers

ROWS = 600
LENGTH = 0.1  # m
JUMP = 0.3  # m


def ends_of(drives, random):
    """Two ends, which move across the arm in proportion to the drives."""
    positions = np.zeros((len(drives), 2, 3))
    positions[..., 2] = LENGTH * np.array([1, 2])
    positions[:, 0, :2] = 0.02 * drives
    positions[:, 1, :2] = 0.06 * drives + 0.01 * drives**2
    positions += random.normal(0, 1e-3, positions.shape)
    axes = np.full(positions.shape, np.nan)
    return MeasuredEnds(drives, positions, axes, np.zeros(len(drives), int))


def smooth_ends(seed, rows=ROWS):
    """Rows that are dense in time."""
    random = np.random.default_rng(seed)
    steps = np.cumsum(random.normal(0, 0.1, (rows, 2)), axis=0)
    return ends_of(np.sin(steps), random)


@pytest.fixture(params=["dense in time", "random order"])
def clean(request):
    """Rows that are dense in time, or steady states in random order."""
    if request.param == "dense in time":
        return smooth_ends(0)
    random = np.random.default_rng(0)
    return ends_of(random.uniform(-1, 1, (ROWS, 2)), random)


def moved(ends, rows, end, offset):
    positions = ends.positions.copy()
    positions[rows, end] += offset
    return ends._replace(positions=positions)


def test_clean_rows_have_no_outliers(clean):
    outliers = find_outliers(clean)
    assert outliers.count == 0
    assert outliers.kinds == ""


@pytest.mark.parametrize("count", [1, 6, 40])
def test_every_jump_is_found_and_nothing_else(clean, count):
    random = np.random.default_rng(count)
    rows = np.sort(random.choice(ROWS, count, replace=False))
    directions = random.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    outliers = find_outliers(moved(clean, rows, 1, JUMP * directions))
    np.testing.assert_array_equal(np.flatnonzero(outliers.jumps[:, 1]), rows)
    assert outliers.count == count


def test_a_run_of_jumps_to_one_place_is_found(clean):
    rows = np.arange(200, 215)
    outliers = find_outliers(moved(clean, rows, 0, [0.0, JUMP, 0.0]))
    np.testing.assert_array_equal(np.flatnonzero(outliers.all[:, 0]), rows)
    assert outliers.count == len(rows)


def test_a_jump_of_the_only_measured_end_is_found(clean):
    tip = clean._replace(positions=clean.positions[:, 1:], axes=clean.axes[:, 1:])
    outliers = find_outliers(moved(tip, [7, 300], 0, [0.0, 0.0, JUMP]))
    np.testing.assert_array_equal(np.flatnonzero(outliers.jumps[:, 0]), [7, 300])


def test_swapped_ends_are_found_as_such(clean):
    positions = clean.positions.copy()
    positions[100:110] = positions[100:110, ::-1]
    outliers = find_outliers(clean._replace(positions=positions))
    swapped = np.flatnonzero(outliers.swaps.all(axis=1))
    np.testing.assert_array_equal(swapped, range(100, 110))
    assert outliers.kinds == "20 swapped bodies"


def test_a_flipped_axis_is_an_outlier():
    ends = smooth_ends(1)
    axes = np.zeros_like(ends.axes)
    axes[..., :2] = 0.3 * ends.drives[:, None]
    axes[..., 2] = 1.0
    axes[50, 1] *= -1
    outliers = find_outliers(ends._replace(axes=axes))
    np.testing.assert_array_equal(np.argwhere(outliers.all), [[50, 1]])


def test_an_impossible_length_is_found_without_known_drives():
    ends = smooth_ends(2)
    unknown = moved(ends, [40], 1, [0.0, 0.0, LENGTH])
    unknown = unknown._replace(drives=np.full_like(ends.drives, np.nan))
    outliers = find_outliers(unknown, [None, LENGTH])
    np.testing.assert_array_equal(np.argwhere(outliers.lengths), [[40, 1]])
    assert outliers.kinds == "1 impossible length"


def test_a_motion_that_the_drives_do_not_explain_is_kept():
    ends = smooth_ends(3)
    push = 0.08 * np.sin(np.linspace(0, np.pi, 100)) ** 2
    pushed = moved(ends, np.arange(200, 300), 1, push[:, None] * [1.0, 0.0, 0.0])
    assert find_outliers(pushed).count == 0


def test_too_many_outliers_are_excessive():
    ends = smooth_ends(4)
    rows = np.arange(0, ROWS, 4)
    outliers = find_outliers(moved(ends, rows, 1, [JUMP, 0.0, 0.0]))
    assert outliers.count > MAX_SHARE * ROWS
    assert outliers.is_excessive


def test_few_and_missing_rows_are_no_outliers():
    ends = smooth_ends(5, 12)
    assert find_outliers(ends).count == 0
    nothing = ends._replace(positions=np.full_like(ends.positions, np.nan))
    outliers = find_outliers(nothing)
    assert not outliers.measured.any()
    assert not outliers.is_excessive
