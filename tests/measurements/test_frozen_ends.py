"""Repeated poses of a lost body are found; an arm at rest and few digits are not."""

import numpy as np
import pytest

from s2c2a.measurements.frozen_ends import find_frozen
from s2c2a.measurements.outliers import MeasuredEnds, find_outliers

ROWS = 800
NOISE = 1e-4  # m


def moving(period=40.0):
    """Values of two drives that always move; the longer the period, the slower."""
    time = np.arange(ROWS) / period
    return np.stack([np.sin(time), np.cos(1.3 * time + 1)], axis=1)


def poses_of(drives, noise=NOISE, digits=None, settling=0.0):
    """Positions of an end that follows two drives."""
    followed = np.empty_like(drives)
    followed[0] = drives[0]
    for row in range(1, len(drives)):
        last = followed[row - 1]
        followed[row] = drives[row] + settling * (last - drives[row])
    bend = 0.1 * followed
    height = 0.3 - 2 * (bend**2).sum(axis=1, keepdims=True)
    poses = np.concatenate([bend, height], axis=1)
    poses += np.random.default_rng(0).normal(0, noise, poses.shape)
    return poses if digits is None else np.round(poses, digits)


def find(drives, poses):
    return np.flatnonzero(find_frozen(drives, poses, np.zeros(len(poses), int)))


def outliers_of(drives, *ends):
    """Outliers of ends without axes."""
    positions = np.stack(ends, axis=1)
    axes = np.full_like(positions, np.nan)
    return find_outliers(MeasuredEnds(drives, positions, axes, np.zeros(ROWS, int)))


# with few digits, a short run may be equal by chance
@pytest.mark.parametrize(
    ("count", "digits"), [(1, None), (5, None), (77, None), (5, 5), (77, 4)]
)
def test_a_repeated_pose_is_found_while_the_drives_change(count, digits):
    drives = moving()
    poses = poses_of(drives, digits=digits)
    poses[201 : 201 + count] = poses[200]
    found = find(drives, poses)
    np.testing.assert_array_equal(found, np.arange(201, 201 + count))


def test_only_the_frozen_end_is_excluded_and_no_jump_is_reported():
    drives = moving()
    inner = 0.5 * poses_of(drives)
    outer = poses_of(drives)
    outer[301:340] = outer[300]
    outliers = outliers_of(drives, inner, outer)
    expected = np.zeros((ROWS, 2), bool)
    expected[301:340, 1] = True
    np.testing.assert_array_equal(outliers.all, expected)
    assert outliers.kinds == "39 frozen poses"


def test_missing_poses_are_no_excess_however_many_are_frozen():
    drives = moving()
    poses = poses_of(drives)
    for begin in range(0, ROWS - 10, 10):
        poses[begin + 1 : begin + 4] = poses[begin]
    outliers = outliers_of(drives, poses)
    assert outliers.frozen.mean() > 0.25
    assert not outliers.is_excessive


def held(rows):
    random = np.random.default_rng(1)
    targets = random.uniform(-1, 1, (-(-ROWS // rows), 2))
    return np.repeat(targets, rows, axis=0)[:ROWS]


def with_rest():
    drives = moving()
    drives[200:600] = drives[200]
    return drives


CALM = {
    "motion": (moving(), 0.0),
    "slow motion": (moving(2000.0), 0.0),
    "rest": (with_rest(), 0.0),
    "settled": (with_rest(), 0.7),
    "held steps": (held(23), 0.7),
    "creep": (held(100), 0.98),
}


@pytest.mark.parametrize("digits", [None, 4, 3])
@pytest.mark.parametrize(
    ("drives", "settling"),
    CALM.values(),
    ids=CALM,
)
@pytest.mark.parametrize("noise", [NOISE, 1e-5])
def test_rest_held_steps_creep_and_few_digits_are_not_frozen(
    drives, settling, digits, noise
):
    assert not len(find(drives, poses_of(drives, noise, digits, settling)))


def test_a_pose_that_is_repeated_across_two_logs_is_not_frozen():
    drives = moving()
    poses = poses_of(drives)
    poses[400] = poses[399]
    stretches = np.repeat([0, 1], ROWS // 2)
    assert not find_frozen(drives, poses, stretches).any()
