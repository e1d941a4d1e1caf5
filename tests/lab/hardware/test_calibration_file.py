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


@pytest.fixture
def calibration():
    return calibration_with(ARM, {id: 100 * id for id in range(1, 10)})


@pytest.fixture
def values(calibration):
    """A calibration as its file has it."""
    return calibration.model_dump(mode="json")


def load(values, path):
    path.write_text(json.dumps(values))
    return load_calibration(path, ARM)


def test_a_calibration_comes_back_from_its_file(calibration, tmp_path):
    save_calibration(calibration, tmp_path / "file.json")
    assert load_calibration(tmp_path / "file.json", ARM) == calibration


def test_homes_have_the_places_of_the_cables(calibration):
    expected = 100 * np.arange(1, 10).reshape(3, 3)
    np.testing.assert_array_equal(calibration.home(ARM), expected)


def test_a_missing_file_tells_how_to_make_one(tmp_path):
    with pytest.raises(CalibrationError, match="s2c2a motors home"):
        load_calibration(tmp_path / "file.json", ARM)


def test_a_calibration_of_another_arm_is_refused(values, tmp_path):
    values["arm"] = "other"
    with pytest.raises(CalibrationError, match="of 'other', not of"):
        load(values, tmp_path / "file.json")


def test_an_unfinished_calibration_is_refused(calibration):
    unfinished = calibration.model_copy(update={"finished": False})
    with pytest.raises(CalibrationError, match="--resume"):
        unfinished.home(ARM)


def test_a_calibration_whose_homings_differ_drives_no_arm(calibration):
    servos = list(calibration.servos)
    servos[4] = servos[4].model_copy(update={"spread": 0.0012})
    differing = calibration.model_copy(update={"servos": tuple(servos)})
    with pytest.raises(CalibrationError, match=r"differ by 1\.2 mm"):
        differing.home(ARM)


def test_a_calibration_without_a_servo_is_refused(calibration):
    lacking = calibration.model_copy(update={"servos": calibration.servos[:-1]})
    with pytest.raises(CalibrationError, match=r"lacks servos \[9\]"):
        lacking.home(ARM)


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


def test_the_firmware_of_a_feetech_servo_fits(values, tmp_path):
    values["servos"][0]["firmware"] = 310
    assert load(values, tmp_path / "file.json").servos[0].firmware == 310
