"""Painted pictures of a collar of tags at known poses, without graphics."""

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags import CameraModel, TagLayout
from s2c2a.lab.tracking.tags.pictures import Effects, Lens, paint

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


def picture(poses, effects: Effects = SHARP, layout: TagLayout = LAYOUT):
    return lens().picture(paint(lens(), layout, poses), effects)


def errors(measured: Pose, true: Pose) -> tuple[float, float]:
    """Errors of position [mm] and rotation [deg]."""
    distance = 1000 * np.linalg.norm(measured.position - true.position)
    cosine = min(1.0, abs(measured.rotation @ true.rotation))
    return float(distance), float(np.degrees(2 * np.arccos(cosine)))
