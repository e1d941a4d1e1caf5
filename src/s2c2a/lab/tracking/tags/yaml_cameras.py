"""Camera models from calibrations of ROS and OpenCV in YAML.

ROS (`camera_calibration`, `camera_info_manager`) and OpenCV (`cv::FileStorage`) write the
same quantities: size of the pictures, camera matrix, distortion coefficients.
"""

import math
import re
from collections.abc import Sequence
from typing import Any

from s2c2a.lab.tracking.poses import TrackingError

try:
    import yaml
except ImportError as error:
    raise TrackingError(
        "calibrations in YAML need PyYAML; install it with "
        '`pip install -c constraints.txt ".[camera]"`, or give a camera file in JSON'
    ) from error

SUFFIXES = (".yaml", ".yml")
MAX_BYTES = 100_000
"""Largest calibration; those with the corners of all pictures have some 10 kB."""
MODEL = "plumb_bob"
"""Of ROS: the distortion of `CameraModel`."""
_WIDTHS = ("image_width", "width")
_HEIGHTS = ("image_height", "height")
_MATRICES = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K")
_DISTORTIONS = (
    "distortion_coefficients",
    "Distortion_Coefficients",
    "dist_coeffs",
    "distCoeffs",
    "D",
)
_ERRORS = ("avg_reprojection_error", "Avg_Reprojection_Error")
KEYS = {
    "width": _WIDTHS[0],
    "height": _HEIGHTS[0],
    "focal_lengths": f"fx and fy of {_MATRICES[0]}",
    "center": f"cx and cy of {_MATRICES[0]}",
    "distortion": _DISTORTIONS[0],
    "rms": _ERRORS[0],
}
"""Of the attributes of a `CameraModel`, what ROS and OpenCV call them."""
# OpenCV writes a form of its own, which YAML does not allow
_OPENCV_HEADER = re.compile(r"\A%YAML[: ]1\.\d\s*\n")
_OPENCV_MATRIX = "tag:yaml.org,2002:opencv-matrix"


class _Loader(yaml.SafeLoader):
    """Plain values and matrices of OpenCV; no anchors, whose copies can be endless."""

    def compose_node(self, parent, index):
        if getattr(self.peek_event(), "anchor", None) is not None:
            raise ValueError("anchors and aliases (& and *) are not allowed")
        return super().compose_node(parent, index)


def _whole_number(loader: _Loader, node: Any) -> int:
    value = loader.construct_yaml_int(node)
    try:
        float(value)
    except OverflowError:
        # Python cannot print such numbers, not even in an error message
        raise ValueError(f"'{node.value:.40}...' is no number of a camera") from None
    return value


_Loader.add_constructor("tag:yaml.org,2002:int", _whole_number)
_Loader.add_constructor(
    _OPENCV_MATRIX, lambda loader, node: loader.construct_mapping(node, deep=True)
)


def camera_values(text: str) -> dict[str, Any]:
    """Return the values of a `CameraModel`, not validated yet.

    Args:
        text: of the file.

    Raises:
        ValueError: it is no such calibration, or of another model of distortion.
    """
    try:
        values = yaml.load(_OPENCV_HEADER.sub("", text), _Loader)
    # a value that its tag does not fit raises anything, such as KeyError
    except Exception as error:
        reason = (
            error if isinstance(error, ValueError | yaml.YAMLError) else repr(error)
        )
        raise ValueError(f"not YAML of ROS or OpenCV: {reason}") from error
    if not isinstance(values, dict):
        raise ValueError("not a table of keys")
    # refuse what `CameraModel` does not describe
    model = values.get("distortion_model", MODEL)
    if model not in (MODEL, "rational_polynomial") or values.get("fisheye_model"):
        raise ValueError(
            f"distortion_model '{model!s:.40}', or a fisheye: calibrate with {MODEL} "
            "(k1, k2, p1, p2, k3)"
        )
    matrix = _numbers(values, _MATRICES)
    is_whole = len(matrix) == 9 and matrix[6:] == [0, 0, 1]
    if not is_whole or matrix[1] or matrix[3]:
        raise ValueError(
            f"{_MATRICES[0]}: write the 9 numbers fx, 0, cx, 0, fy, cy, 0, 0, 1, got "
            f"{matrix}"
        )
    return {
        "width": _value(values, _WIDTHS),
        "height": _value(values, _HEIGHTS),
        "focal_lengths": [matrix[0], matrix[4]],
        "center": [matrix[2], matrix[5]],
        "distortion": _distortion(_numbers(values, _DISTORTIONS)),
        "rms": next((values[name] for name in _ERRORS if name in values), 0.0),
    }


def _value(values: dict, names: Sequence[str]) -> Any:
    for name in names:
        if name in values:
            return values[name]
    raise ValueError(f"{names[0]}: this key is missing")


def _numbers(values: dict, names: Sequence[str]) -> list[float]:
    """Numbers of a matrix, which is a table with `data`, or a list."""
    given = _value(values, names)
    if isinstance(given, dict):
        given = given.get("data")
    if not isinstance(given, list):
        raise ValueError(f"{names[0]}: write a table with the list `data`")
    try:
        return [float(value) for value in given]
    except (TypeError, ValueError) as error:
        raise ValueError(f"{names[0]}: write numbers only") from error


def _distortion(given: list[float]) -> list[float]:
    """k1, k2, p1, p2, k3; further coefficients must be zero."""
    used = given[:5]
    beyond = given[5:]
    if not all(map(math.isfinite, given)) or len(given) < 4 or any(beyond):
        raise ValueError(
            f"{_DISTORTIONS[0]}: write k1, k2, p1, p2, k3; further ones must be zero, "
            f"got {given[:20]}; calibrate with {MODEL}"
        )
    return [*used, 0.0][:5]
