"""Camera models and calibration boards, and their files."""

import math
import os
import re
from pathlib import Path

import numpy as np
from jaxtyping import Float
from pydantic import Field, ValidationError, model_validator

from s2c2a.files.json_files import load_json, save_json
from s2c2a.files.text import read_text
from s2c2a.files.validation import explained
from s2c2a.lab.tracking.poses import StoredTable, TrackingError
from s2c2a.lab.tracking.tags import yaml_cameras

FORMAT = 1
DISTORTIONS = 5  # k1, k2, p1, p2, k3
MAX_SIDE = 10_000  # pixels
ADVICE = "make one with `s2c2a tracking calibrate-camera`"


class CameraError(TrackingError):
    """A camera model is damaged, or cannot be found from the pictures."""


class Board(StoredTable):
    """A ChArUco board: a chess board with a marker in every white square.

    Attributes:
        columns: of squares.
        rows: of squares.
        square: side of a square [m].
        marker: side of a marker [m], less than that of a square.
    """

    columns: int = Field(default=7, strict=True, ge=3, le=14)
    rows: int = Field(default=5, strict=True, ge=3, le=14)
    square: float = Field(default=0.035, gt=0.001, le=0.5)
    marker: float = Field(default=0.02625, gt=0.0005, le=0.5)

    @model_validator(mode="after")
    def _check_marker(self) -> "Board":
        if not 0.4 * self.square <= self.marker <= 0.9 * self.square:
            raise ValueError("marker: write 0.4 to 0.9 times the side of a square")
        return self


class CameraModel(StoredTable):
    """Projection of a camera: pinhole with radial and tangential distortion.

    A point (x, y, z) of the camera frame (x right, y down, z forward) appears at
    `center + focal_lengths * distorted(x / z, y / z)`, in pixels whose centers have
    whole coordinates. The distortion is the polynomial of OpenCV's camera model.

    Attributes:
        width: of the pictures [pixels].
        height: of the pictures [pixels].
        focal_lengths: horizontal and vertical [pixels].
        center: principal point, column and row [pixels].
        distortion: coefficients k1, k2, p1, p2, k3.
        rms: root mean square error of the calibration [pixels].
        views: pictures of the calibration.
        board: of the calibration; None if the model was made otherwise.
    """

    format: int = Field(default=FORMAT, ge=FORMAT, le=FORMAT)
    width: int = Field(strict=True, ge=16, le=MAX_SIDE)
    height: int = Field(strict=True, ge=16, le=MAX_SIDE)
    focal_lengths: tuple[float, float]
    center: tuple[float, float]
    distortion: tuple[float, ...] = Field(
        default=(0.0,) * DISTORTIONS, min_length=DISTORTIONS, max_length=DISTORTIONS
    )
    rms: float = Field(default=0.0, ge=0, le=100)
    views: int = Field(default=0, strict=True, ge=0, le=10_000)
    board: Board | None = None

    @model_validator(mode="after")
    def _check_lens(self) -> "CameraModel":
        side = max(self.width, self.height)
        if not all(0.1 * side <= length <= 100 * side for length in self.focal_lengths):
            raise ValueError("focal_lengths: write 0.1 to 100 times the longer side")
        column, row = self.center
        if not (0 <= column <= self.width and 0 <= row <= self.height):
            raise ValueError("center: write a point of the picture")
        if max(map(abs, self.distortion)) > 10:
            raise ValueError("distortion: write coefficients of at most 10")
        return self

    @property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """Intrinsic matrix [pixels]."""
        (horizontal, vertical) = self.focal_lengths
        (column, row) = self.center
        return np.array([[horizontal, 0, column], [0, vertical, row], [0, 0, 1.0]])

    @property
    def coefficients(self) -> Float[np.ndarray, " 5"]:
        """Distortion coefficients."""
        return np.array(self.distortion)

    @property
    def field_of_view(self) -> float:
        """Horizontal field of view without distortion [deg]."""
        half = math.atan(self.width / 2 / self.focal_lengths[0])
        return math.degrees(2 * half)


def save_camera(camera: CameraModel, path: str | os.PathLike) -> None:
    """Write a camera file; an interruption leaves the former file.

    Raises:
        CameraError: the file cannot be written.
    """
    save_json(camera, path, CameraError)


def load_camera(path: str | os.PathLike) -> CameraModel:
    """Read a camera file, or a calibration of ROS or OpenCV (.yaml, .yml).

    Raises:
        CameraError: there is no such file, or it is damaged.
    """
    if Path(path).suffix.lower() in yaml_cameras.SUFFIXES:
        return _load_yaml(path)
    return load_json(CameraModel, path, CameraError, "camera model", ADVICE)


def _load_yaml(path: str | os.PathLike) -> CameraModel:
    text = read_text(path, CameraError, yaml_cameras.MAX_BYTES)
    try:
        return CameraModel.model_validate(yaml_cameras.camera_values(text))
    except ValidationError as error:
        faults = explained(error, "{faults}", CameraModel.model_fields)
        for name, key in yaml_cameras.KEYS.items():
            faults = re.sub(rf"\b{name}\b", key, faults)
        count, _, lines = faults.partition("\n")
        raise CameraError(
            f"{path}: {count} in the calibration; {ADVICE}\n{lines}"
        ) from error
    except (ValueError, RecursionError) as error:
        raise CameraError(
            f"{path} is no calibration of ROS or OpenCV: {error}; {ADVICE}"
        ) from error
