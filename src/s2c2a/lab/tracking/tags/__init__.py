"""Poses from AprilTags in front of a webcam; the only package that knows OpenCV."""

from s2c2a.lab.tracking.tags.calibration import (
    BoardView,
    calibrate,
    find_board,
    is_new_view,
)
from s2c2a.lab.tracking.tags.camera import Board, CameraModel, load_camera, save_camera
from s2c2a.lab.tracking.tags.capture import PictureSource, open_device
from s2c2a.lab.tracking.tags.detection import TagDropReason
from s2c2a.lab.tracking.tags.estimation import TagPoses, estimate_poses
from s2c2a.lab.tracking.tags.layout import Tag, TagLayout, load_layout, save_layout
from s2c2a.lab.tracking.tags.tracker import TagTracker, tag_tracker
