"""Logs with marker jumps are imported as without them."""

import numpy as np
import pytest
from simulated_logs import record, write_log  # type: ignore[import-not-found]

from s2c2a.logs import map_from_toml
from s2c2a.logs.cleaning import exclude_outliers
from s2c2a.logs.errors import LogError
from s2c2a.logs.pipeline import _read_takes
from s2c2a.logs.registration import estimate_registration
from s2c2a.measurements import outliers

JUMP = 0.3  # m


@pytest.fixture(scope="module")
def recording(twin, tmp_path_factory):
    return record(tmp_path_factory.mktemp("clean") / "twin.episodes", twin)


def with_jumps(path, rows, module):
    """Log with jumps of one end in some rows."""
    with path.open() as file:
        header = file.readline().strip()
    values = np.loadtxt(path, delimiter=",", skiprows=1)
    values[np.ix_(rows, [header.split(",").index(f"x{module}")])] += JUMP
    damaged = path.with_name("damaged.csv")
    np.savetxt(damaged, values, "%.7g", ",", header=header, comments="")
    return damaged


@pytest.mark.slow
@pytest.mark.parametrize("tip_only", [False, True])
def test_jumps_are_excluded_and_reported_and_others_are_kept(
    recording, tip_only, tmp_path
):
    log = write_log(tmp_path, recording, tip_only)
    log_map = map_from_toml(log.map)
    clean = _read_takes([log.path], log_map)
    _, nothing = exclude_outliers(clean, log_map)
    assert str(nothing) == ""
    damaged = with_jumps(log.path, [12, 40, 77, 300], 2)
    takes, excluded = exclude_outliers(_read_takes([damaged], log_map), log_map)
    poses = 500 if tip_only else 1500
    assert str(excluded) == (
        f"excluded 4 of {poses} poses: 4 marker jumps; first in rows 12, 40, 77 "
        "(docs/guides/import.md)"
    )
    unknown = np.isnan(takes[0].positions).any(axis=-1)
    np.testing.assert_array_equal(np.flatnonzero(unknown[:, -1]), [12, 40, 77, 300])
    assert unknown.sum() == 4
    np.testing.assert_array_equal(takes[0].commanded, clean[0].commanded)


def test_the_first_frame_does_not_tilt_with_marker_jumps(recording, tmp_path):
    log = write_log(tmp_path, recording, tip_only=False)
    lines = log.map.splitlines()
    log_map = map_from_toml("\n".join(x for x in lines if not x.startswith("along")))
    frames = []
    for path in (log.path, with_jumps(log.path, [12, 40, 77], 2)):
        takes, _ = exclude_outliers(_read_takes([path], log_map), log_map)
        frames.append(estimate_registration(takes[0].positions, log_map).axes)
    cosines = np.sum(frames[0] * frames[1], axis=0)
    # a first guess from medians of rows, which the fit of the cables refines
    assert np.rad2deg(np.arccos(cosines.clip(-1, 1))).max() < 0.5


def test_too_many_outliers_are_refused_unless_the_map_keeps_them(
    recording, tmp_path, monkeypatch
):
    monkeypatch.setattr(outliers, "MAX_SHARE", 0.005)
    log = write_log(tmp_path, recording, tip_only=True)
    damaged = with_jumps(log.path, [12, 40, 77, 300], 2)
    log_map = map_from_toml(log.map)
    takes = _read_takes([damaged], log_map)
    with pytest.raises(LogError, match=r"1 % of the poses .* module 3 .*keep"):
        exclude_outliers(takes, log_map)
    keep = map_from_toml(log.map.replace("[rows]", '[rows]\noutliers = "keep"'))
    kept, excluded = exclude_outliers(takes, keep)
    np.testing.assert_array_equal(kept[0].positions, takes[0].positions)
    assert excluded.outliers is None
    assert not str(excluded)
