"""Calibration files: round trip, and files that are damaged or belong elsewhere."""

import json

import numpy as np
import pytest
from homes import calibration_with

from s2c2a.arm import load_arm
from s2c2a.lab.hardware.calibration import (
    CalibrationError,
    load_calibration,
    save_calibration,
)

ARM = load_arm("twin_arm")
CALIBRATION = calibration_with(ARM, {id: 100 * id for id in range(1, 10)})
SERVOS = CALIBRATION.servos


@pytest.fixture
def values():
    """A calibration as its file has it."""
    return CALIBRATION.model_dump(mode="json")


def load(values, path):
    path.write_text(json.dumps(values))
    return load_calibration(path, ARM)


def test_a_calibration_comes_back_from_its_file(tmp_path):
    save_calibration(CALIBRATION, tmp_path / "file.json")
    assert load_calibration(tmp_path / "file.json", ARM) == CALIBRATION


def test_homes_have_the_places_of_the_cables():
    expected = 100 * np.arange(1, 10).reshape(3, 3)
    np.testing.assert_array_equal(CALIBRATION.home(ARM), expected)


def test_a_missing_file_tells_how_to_make_one(tmp_path):
    with pytest.raises(CalibrationError, match="s2c2a motors home"):
        load_calibration(tmp_path / "file.json", ARM)


def test_a_calibration_of_another_arm_is_refused(values, tmp_path):
    values["arm"] = "other"
    with pytest.raises(CalibrationError, match="of 'other', not of"):
        load(values, tmp_path / "file.json")


DIFFERING = SERVOS[0].model_copy(update={"spread": 0.0012})


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"finished": False}, "--resume"),
        ({"servos": SERVOS[:-1]}, r"lacks servos \[9\]"),
        ({"servos": (DIFFERING, *SERVOS[1:])}, r"differ by 1\.2 mm"),
    ],
)
def test_a_calibration_that_is_unfinished_or_unsound_drives_no_arm(change, text):
    with pytest.raises(CalibrationError, match=text):
        CALIBRATION.model_copy(update=change).home(ARM)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("home", 1.5),
        ("home", 2**40),
        ("home", None),
        ("home", True),
        ("id", 253),
        ("firmware", -1),
        ("spread", float("nan")),
        ("model", "x" * 41),
        ("unknown", 1),
    ],
)
def test_a_damaged_servo_is_refused(values, tmp_path, key, value):
    values["servos"][4][key] = value
    with pytest.raises(CalibrationError, match="1 fault in the calibration"):
        load(values, tmp_path / "file.json")


def test_a_servo_that_stands_in_it_twice_is_refused(values, tmp_path):
    values["servos"][4]["id"] = 1
    with pytest.raises(CalibrationError, match="twice"):
        load(values, tmp_path / "file.json")


def test_a_huge_number_of_servos_is_refused(values, tmp_path):
    values["servos"] *= 200
    with pytest.raises(CalibrationError, match="calibration"):
        load(values, tmp_path / "file.json")
