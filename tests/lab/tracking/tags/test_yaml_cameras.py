"""Calibrations of ROS and OpenCV are camera files, and strangers' YAML runs nothing."""

import cv2
import numpy as np
import pytest

from s2c2a.lab.tracking.tags import CameraModel, load_camera
from s2c2a.lab.tracking.tags.camera import CameraError

EXPECTED = CameraModel(
    width=640,
    height=480,
    focal_lengths=(438.5, 437.25),
    center=(305.5, 245.125),
    distortion=(-0.36, 0.11, 1e-05, -0.0005, 0.0),
)
FOUR = "-0.36, 0.11, 1e-05, -0.0005"
ROS = """\
image_width: 640
image_height: 480
camera_name: head_camera
camera_matrix:
  rows: 3
  cols: 3
  data: [438.5, 0.0, 305.5, 0.0, 437.25, 245.125, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.36, 0.11, 1e-05, -0.0005, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
"""


@pytest.fixture
def load(tmp_path):
    def load_text(text, name="camera.yaml"):
        (tmp_path / name).write_text(text)
        return load_camera(tmp_path / name)

    return load_text


def test_a_calibration_of_ros_is_a_camera(load):
    assert load(ROS) == EXPECTED


def test_a_calibration_that_opencv_writes_is_a_camera(tmp_path):
    path = tmp_path / "camera.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Fri Nov 27 09:00:00 2026")
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", EXPECTED.matrix)
    storage.write("distortion_coefficients", np.array([EXPECTED.distortion]).T)
    storage.write("avg_reprojection_error", 0.25)
    storage.release()
    text = path.read_text()
    assert "!!opencv-matrix" in text
    assert load_camera(path) == EXPECTED.model_copy(update={"rms": 0.25})
    # OpenCV before 5 writes its header with a colon
    path.write_text("%YAML:1.0\n---\n" + text.split("---", 1)[1])
    assert load_camera(path).width == 640


@pytest.mark.parametrize("numbers", [FOUR, FOUR + ", 0.0, 0, 0, 0.0"])
def test_missing_and_further_coefficients_are_zero(load, numbers):
    assert load(ROS.replace(FOUR + ", 0.0", numbers)) == EXPECTED


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("plumb_bob", "equidistant", "plumb_bob"),
        ("-0.0005, 0.0]", "-0.0005, 0.0, 0.3, 0.1, 0.2]", "further ones must be zero"),
        ("-0.0005, 0.0]", "-0.0005, .nan]", "distortion_coefficients"),
        ("[-0.36, 0.11,", "[-0.36, [0.11],", "numbers only"),
        ("image_width: 640\n", "", "image_width: this key is missing"),
        ("image_width: 640", "image_width: 1.0e+9", " image_width: write"),
        ("image_width: 640", "image_width: true", " image_width: write"),
        ("image_width: 640", f"image_width: 0x{'f' * 4300}", "'0xfff.*no number"),
        ("438.5", ":".join(["59"] * 4300), "'59:59.*no number"),
        ("438.5", ":".join(["59"] * 400) + ".5", "OverflowError"),
        ("640", "!!bool x", "KeyError"),
        ("640", "!!timestamp x", "AttributeError"),
        ("[438.5, 0.0,", "[438.5, 3.0,", "fx, 0, cx"),
        ("[438.5, 0.0,", "[.inf, 0.0,", "fx and fy of camera_matrix"),
        ("305.5, 0.0", "3050, 0.0", "cx and cy of camera_matrix: write a point"),
        ("camera_matrix:", "matrix:", "camera_matrix: this key is missing"),
        ("[438.5", "[", "fx, 0, cx|not YAML"),
        ("rows: 3", "rows: &a 3", "anchors"),
        ("rows: 3", "rows: *a", "not YAML"),
        ("head_camera", "!!python/object/apply:os.getcwd []", "not YAML"),
        ("head_camera", "[" * 5000, "no calibration"),
    ],
)
def test_what_is_wrong_in_a_calibration_is_named(load, old, new, fault):
    assert old in ROS
    with pytest.raises(CameraError, match=fault):
        load(ROS.replace(old, new, 1))
