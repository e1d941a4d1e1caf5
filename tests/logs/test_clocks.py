"""Clocks of two files are estimated from the motion, and the files are joined."""

import numpy as np
import pytest
from moving_arm import two_clocks  # type: ignore[import-not-found]
from scipy.spatial.transform import Rotation

from s2c2a.logs import map_from_toml
from s2c2a.logs.clocks import LogClock, estimate_clock
from s2c2a.logs.errors import LogError
from s2c2a.logs.tables import Table
from s2c2a.logs.take import build_take
from s2c2a.logs.timed_motion import TimedMotion

MAP = """
[rows]
kind = "timed"
time = "t"
{rows}
[join]
by = "time"
{join}
[arm]
name = "a"
modules = 2
control_rate = 10
{drives}
[[ends]]
position = ["x", "y", "z"]
unit = "m"
{end}
"""


def make_map(join="", drives=1, rows="", end=""):
    text = "".join(
        f'[[drives]]\nmeasured = "m{index}"\nunit = "m"\n' for index in range(drives)
    )
    return map_from_toml(MAP.format(join=join, drives=text, rows=rows, end=end))


def errors_of(clock, log):
    """Errors of the converted times of the tip [s]."""
    return clock.convert(log.tip.time) - log.truth


def columns_of(names, values):
    return dict(zip(names, values.T, strict=True))


def motors_of(log, times=None):
    """Table of the drives."""
    times = log.drives.time if times is None else times
    drives = columns_of([f"m{index}" for index in range(8)], log.drives.values)
    return Table("motors", {"t": times} | drives, {})


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_offset_and_drift_of_an_arm_with_backlash_and_lag_are_within_5_ms(seed):
    log = two_clocks(seed)
    clock = estimate_clock(log.drives, log.tip)
    assert np.abs(errors_of(clock, log)).max() < 0.005
    assert abs(clock.drift - 50e-6) < 4 * clock.drift_std
    assert 0 < clock.offset_std < 0.005
    assert 0 < clock.drift_std < 100e-6


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 3])
def test_deviations_are_honest_with_strong_backlash_and_lag(seed):
    log = two_clocks(seed, lag=0.12, backlash=0.15)
    clock = estimate_clock(log.drives, log.tip)
    errors = errors_of(clock, log)
    assert np.abs(errors).max() < 0.007
    assert abs(np.median(errors)) < 3 * clock.offset_std
    assert abs(clock.drift - 50e-6) < 3 * clock.drift_std
    assert clock.offset_std < 0.005


@pytest.mark.slow
def test_gaps_and_marker_jumps_do_not_move_the_clock():
    log = two_clocks(4)
    kept = (log.drives.time < 40) | (log.drives.time > 48)
    drives = TimedMotion(log.drives.time[kept], log.drives.values[kept])
    tip = log.tip.values.copy()
    tip[::50] += 0.3
    clock = estimate_clock(drives, TimedMotion(log.tip.time, tip))
    assert np.abs(errors_of(clock, log)).max() < 0.01


@pytest.mark.slow
def test_files_with_clocks_since_1970_and_since_0_are_joined():
    log = two_clocks(5, offset=0.37)
    epoch = 1.7e9
    motors = motors_of(log, np.round((log.drives.time + epoch) * 1e9))
    tip = columns_of("xyz", log.tip.values)
    camera = Table("camera", {"seconds": log.tip.time} | tip, {})
    log_map = make_map('times = ["t", "seconds"]\nunits = ["ns", "s"]', 8)
    take = build_take([motors, camera], log_map)
    (clock,) = take.clocks
    assert np.abs(errors_of(clock, log) - epoch).max() < 0.005
    expected = np.interp(log.drives.time, log.truth, log.tip.values[:, 0])
    known = np.isfinite(take.positions[:, 0, 0])
    assert known.mean() > 0.98
    errors = take.positions[known, 0, 0] - expected[known]
    assert np.sqrt(np.mean(errors**2)) < 0.001
    assert "ppm" in str(clock)
    assert "only the difference of offset and lag" in str(clock)
    assert clock.summary()["offset"] == clock.offset


@pytest.mark.slow
def test_a_base_that_moves_does_not_move_the_clock():
    log = two_clocks(5, offset=0.37)
    angles = 0.8 * np.sin(0.9 * log.tip.time)
    base = 2.0 * np.stack([angles, np.cos(angles), 0.5 * angles], axis=1)
    turns = Rotation.from_euler("y", angles[:, None])
    tip = turns.apply(log.tip.values) + base
    values = np.hstack([log.tip.time[:, None], tip, base, turns.as_quat()])
    camera = Table("camera", columns_of("txyzXYZABCD", values), {})
    body = """
[frame.body]
position = ["X", "Y", "Z"]
unit = "m"
quaternion = ["A", "B", "C", "D"]
order = "xyzw"
"""
    log_map = make_map('times = ["t", "t"]', 8, end=body)
    (clock,) = build_take([motors_of(log), camera], log_map).clocks
    assert np.abs(errors_of(clock, log)).max() < 0.005


def test_stamps_and_times_since_1970_are_joined_by_their_own_units():
    """Stamps are seconds, whatever the unit of other files; the size tells that of times."""
    times = np.arange(20.0)
    stamped = Table("a", {"t": 1.7e9 + times, "m0": times}, {}, stamps=frozenset("t"))
    rotation = {f"r{k}": np.full(20, v) for k, v in enumerate(np.eye(3).flat)}
    tip = {"x": 2 * times, "y": times, "z": times}
    camera = Table("b", {"ns": (1.7e9 + times) * 1e9} | tip | rotation, {})
    names = ", ".join(f'"r{index}"' for index in range(9))
    log_map = make_map('times = ["t", "ns"]\noffset = [0.5]', end=f"matrix = [{names}]")
    take = build_take([stamped, camera], log_map)
    np.testing.assert_allclose(take.time, 1.7e9 + times)
    np.testing.assert_allclose(take.positions[1:, 0, 0], 2 * times[1:] - 1.0, atol=1e-5)
    np.testing.assert_allclose(take.axes[1:, 0], [[0.0, 0.0, 1.0]] * 19, atol=1e-9)


@pytest.mark.slow
def test_repeated_motion_and_foreign_files_are_refused():
    repeated = two_clocks(0, poses=4)
    with pytest.raises(LogError, match="explain the motion about equally well"):
        estimate_clock(repeated.drives, repeated.tip)
    with pytest.raises(LogError, match="check that the files belong together"):
        estimate_clock(two_clocks(1).drives, two_clocks(2).tip)


def test_rest_is_refused():
    log = two_clocks(0, span=10.0)
    rest = TimedMotion(log.tip.time, np.zeros_like(log.tip.values))
    with pytest.raises(LogError, match="the ends do not move"):
        estimate_clock(log.drives, rest)


def test_an_inverted_clock_returns():
    clock = LogClock(0.37, 50e-6, 10.0)
    times = np.array([0.0, 1e3, 1e5])
    returned = clock.inverted().convert(clock.convert(times))
    np.testing.assert_allclose(returned, times, atol=1e-9)


def test_columns_are_interpolated_within_the_longest_gap_and_rotations_on_the_arc():
    end = 'quaternion = ["a", "b", "c", "d"]\norder = "xyzw"\nalong = "x"'
    log_map = make_map("offset = [10.0]", rows="longest_gap = 1.0", end=end)
    motors = Table("motors", {"t": np.array([10.5, 12.5]), "m0": np.zeros(2)}, {})
    turns = Rotation.from_euler("z", [[0.0], [90.0], [90.0]], degrees=True).as_quat()
    turns[1] *= -1  # the same rotation
    camera = {"t": np.array([0.0, 1.0, 4.0])} | columns_of("abcd", turns)
    camera |= dict.fromkeys("xyz", np.arange(3.0))
    take = build_take([motors, Table("camera", camera, {})], log_map)
    np.testing.assert_allclose(take.positions[0, 0], 0.5)
    np.testing.assert_allclose(take.axes[0, 0], [0.5**0.5, 0.5**0.5, 0], atol=1e-9)
    assert np.isnan(take.positions[1]).all()
    assert np.isnan(take.axes[1]).all()
    assert "(stated)" in str(take.clocks[0])


@pytest.mark.parametrize(
    ("join", "message"),
    [
        ('key = "t"', "by equal keys, by time or row by row"),
        ('times = ["t"]', "1 times for 2 files"),
        ("offset = [0.0, 0.0]", "2 offset for 2 files"),
    ],
)
def test_a_join_that_contradicts_itself_is_refused(join, message):
    with pytest.raises(LogError, match=message):
        make_map(join)


def test_a_missing_time_column_and_falling_times_are_named():
    log_map = make_map('times = ["t", "s"]\noffset = [0.0]')
    motors = Table("motors", {"t": np.arange(3.0), "m0": np.zeros(3)}, {})
    position = {name: np.zeros(3) for name in "xyz"}
    with pytest.raises(LogError, match="camera lacks the time column 's'"):
        build_take([motors, Table("camera", position, {})], log_map)
    camera = Table("camera", position | {"s": np.array([0.0, 2.0, 1.0])}, {})
    with pytest.raises(LogError, match="'s' falls after row 1"):
        build_take([motors, camera], log_map)
