"""Painted pictures of a collar of tags at known poses, without graphics."""

import math
from functools import cache

import numpy as np
from pictures import BACKGROUND, Effects, Lens, paint
from scipy.spatial.transform import Rotation

from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags import CameraModel, TagLayout
from s2c2a.lab.tracking.tags.opencv import cv2

CAMERA = CameraModel(
    width=640,
    height=360,
    focal_lengths=(560.0, 556.0),
    center=(325.0, 176.0),
    distortion=(0.05, -0.1, 0.001, -0.0005, 0.0),
)
LAYOUT = TagLayout.collars(1)
UPRIGHT = Rotation.from_rotvec([np.pi / 2, 0, 0])  # the arm points up in the picture
SHARP = Effects(noise=1.5, blur=0.5)


@cache
def lens() -> Lens:
    return Lens(CAMERA)


def collar_pose(position=(0.02, -0.01, 0.4), turn_deg=30.0, tilt_deg=10.0) -> Pose:
    """`T_camera_body` of an arm that is turned about its axis, then tilted."""
    turn = Rotation.from_rotvec([0, 0, np.radians(turn_deg)])
    tilt = Rotation.from_rotvec([np.radians(tilt_deg), 0, 0])
    rotation = tilt * UPRIGHT * turn
    return Pose(np.array(position), rotation.as_quat())


def picture(
    poses,
    effects: Effects = SHARP,
    layout: TagLayout = LAYOUT,
    motion: tuple[float, float] = (0, 0),
    covered: tuple[int, int, int, int] = (0, 0, 0, 0),
):
    """A picture during whose exposure the camera moves, or of which a part is hidden.

    Args:
        poses: `T_camera_body` by name.
        effects: blur and noise.
        layout: of the tags.
        motion: columns and rows.
        covered: left, top, width and height of a rectangle [pixels].
    """
    image = lens().picture(paint(lens(), layout, poses))
    left, top, width, height = covered
    image[top : top + height, left : left + width] = BACKGROUND
    return effects.on(cv2.filter2D(image, -1, motion_kernel(motion)))


def motion_kernel(motion: tuple[float, float]) -> np.ndarray:
    """Equal weights along a line through the center."""
    half = math.ceil(max(map(abs, motion)) / 2) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    for share in np.linspace(-0.5, 0.5, 201):
        column = half + share * motion[0]
        row = half + share * motion[1]
        left = math.floor(column)
        top = math.floor(row)
        right_share = column - left
        low_share = row - top
        kernel[top, left] += (1 - right_share) * (1 - low_share)
        kernel[top, left + 1] += right_share * (1 - low_share)
        kernel[top + 1, left] += (1 - right_share) * low_share
        kernel[top + 1, left + 1] += right_share * low_share
    return kernel / kernel.sum()


def errors(measured: Pose, true: Pose) -> tuple[float, float]:
    """Errors of position [mm] and rotation [deg]."""
    distance = 1000 * np.linalg.norm(measured.position - true.position)
    cosine = min(1.0, abs(measured.rotation @ true.rotation))
    return float(distance), float(np.degrees(2 * np.arccos(cosine)))
