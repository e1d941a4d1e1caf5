import json

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.lab.tracking import Pose
from s2c2a.lab.tracking.calibration import (
    FrameResidual,
    TrackingCalibration,
    TrackingCalibrationError,
    calibration_path,
    describe_tracking_calibration,
    load_or_empty,
    load_tracking_calibration,
    save_tracking_calibration,
)

ARM = load_arm("twin_arm")
IDENTITY = {"position": [0, 0, 0], "rotation": [0, 0, 0, 1]}
TURNED = Pose([0.01, -0.02, 0.3], [0.0, 0.0, 0.6, 0.8])


@pytest.fixture
def calibration():
    residuals = {"end-1": FrameResidual(position=0.001, rotation=0.01)}
    empty = TrackingCalibration.empty(ARM)
    return empty.with_frames(TURNED, {"end-1": TURNED}, residuals)


def test_a_calibration_survives_its_file(tmp_path, calibration):
    path = tmp_path / calibration_path(ARM)
    complete = calibration.with_latency(0.02, 0.001)
    save_tracking_calibration(complete, path)
    assert load_tracking_calibration(path, ARM) == complete


def test_unknown_offsets_are_identities(calibration):
    ends = TrackingCalibration.empty(ARM).ends(ARM)
    assert np.array_equal(ends.base_offset.position, np.zeros(3))
    known = calibration.ends(ARM).end_offsets["end-1"]
    assert np.allclose(known.position, TURNED.position)


def test_a_missing_file_is_empty_or_an_error(tmp_path):
    path = tmp_path / "none.json"
    assert load_or_empty(path, ARM).latency is None
    with pytest.raises(TrackingCalibrationError, match="no tracking calibration"):
        load_tracking_calibration(path, ARM)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"latency": "soon"}, "latency"),
        ({"latency": 5.0}, "latency"),
        ({"latencies": 0.1}, "latencies"),
        ({"base_offset": {"position": [0, 0, 0], "rotation": [1, 1, 0, 0]}}, "length"),
        ({"end_offsets": {"end-9": IDENTITY}}, "end-9"),
        ({"arm": "other"}, "'other', not of 'twin_arm'"),
    ],
)
def test_a_damaged_file_or_that_of_another_arm_is_refused(
    tmp_path, calibration, change, message
):
    path = tmp_path / "damaged.json"
    values = calibration.model_dump(mode="json") | change
    path.write_text(json.dumps(values))
    for load in (load_tracking_calibration, load_or_empty):
        with pytest.raises(TrackingCalibrationError, match=message):
            load(path, ARM)


def test_a_calibration_is_described_with_its_parts(tmp_path, calibration, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert describe_tracking_calibration(ARM).startswith("none (twin_arm.tracking.json")
    complete = calibration.with_latency(0.02, 0.001)
    save_tracking_calibration(complete, calibration_path(ARM))
    text = describe_tracking_calibration(ARM)
    assert text.startswith("twin_arm.tracking.json of 20")
    assert text.endswith("latency 20 ms, frames of end-1")
