"""Painted pictures of tags at known poses by a given camera, without graphics."""

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags import CameraModel, TagLayout
from s2c2a.lab.tracking.tags.detection import tag_dictionary
from s2c2a.lab.tracking.tags.layout import CELLS, SHEET, square
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
OVERSAMPLING = 2
BACKGROUND = 130  # gray value
WHITE = 225  # gray value of printed paper
BLACK = 25
CELL_PIXELS = 8  # of a texture


def collar_pose(position=(0.02, -0.01, 0.4), turn_deg=30.0, tilt_deg=10.0) -> Pose:
    """`T_camera_body` of an arm that is turned about its axis, then tilted."""
    turn = Rotation.from_rotvec([0, 0, np.radians(turn_deg)])
    tilt = Rotation.from_rotvec([np.radians(tilt_deg), 0, 0])
    rotation = tilt * UPRIGHT * turn
    return Pose(np.array(position), rotation.as_quat())


class Lens:
    """Makes a camera's pictures of ideal ones, larger and without distortion."""

    def __init__(self, camera: CameraModel):
        self._size = (camera.width, camera.height)
        self._focal = OVERSAMPLING * max(camera.focal_lengths)
        columns, rows = (
            (np.arange(OVERSAMPLING * side) + 0.5) / OVERSAMPLING - 0.5
            for side in self._size
        )
        pixels = np.stack(np.meshgrid(columns, rows), axis=-1)
        rays = cv2.undistortPoints(
            pixels.reshape(-1, 1, 2), camera.matrix, camera.coefficients
        ).reshape(pixels.shape)
        half = np.ceil(self._focal * np.abs(rays).max(axis=(0, 1))).astype(int) + 2
        self._ideal_size = (2 * half).tolist()
        self._center = half - 0.5
        self._map = (self._focal * rays + self._center).astype(np.float32)

    def picture(self, sheets) -> np.ndarray:
        """The camera's picture of flat sheets; what is nearer hides what is farther.

        Args:
            sheets: corners [m], camera frame, and what is printed on them, 8 bit.
        """
        ideal = np.full(self._ideal_size[::-1], BACKGROUND, np.uint8)
        farthest_first = sorted(
            sheets, key=lambda sheet: -np.linalg.norm(sheet[0].mean(axis=0))
        )
        for corners, texture in farthest_first:
            pixels = self._focal * corners[:, :2] / corners[:, 2:] + self._center
            height, width = texture.shape
            source = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
            warp = cv2.getPerspectiveTransform(
                source.astype(np.float32), pixels.astype(np.float32)
            )
            edge = cv2.BORDER_TRANSPARENT
            cv2.warpPerspective(texture, warp, self._ideal_size, ideal, borderMode=edge)
        columns, rows = np.moveaxis(self._map, -1, 0)
        sampled = cv2.remap(ideal, columns, rows, cv2.INTER_LINEAR)
        return cv2.resize(sampled, self._size, interpolation=cv2.INTER_AREA)


LENS = Lens(CAMERA)


@cache
def tag_texture(id: int) -> np.ndarray:
    """The picture of a tag with its white margin, 8 bit, square."""
    marker = cv2.aruco.generateImageMarker(tag_dictionary(), id, CELLS)
    cells = np.where(np.pad(marker, 1, constant_values=255) > 0, WHITE, BLACK)
    return np.kron(cells, np.ones((CELL_PIXELS, CELL_PIXELS))).astype(np.uint8)


def taken(image: np.ndarray, noise=1.5, blur=0.5, seed=0) -> np.ndarray:
    """A picture with noise of the gray values and a Gaussian blur [pixels]."""
    if blur:
        image = cv2.GaussianBlur(image, (0, 0), blur)
    changes = np.random.default_rng(seed).normal(0, noise, image.shape)
    return np.clip(np.rint(image + changes), 0, 255).astype(np.uint8)


def picture(poses, layout=LAYOUT, motion=(0, 0), covered=(0, 0, 0, 0), **effects):
    """A picture during whose exposure the camera moves, or of which a part is hidden.

    Args:
        poses: `T_camera_body` by name.
        layout: of the tags.
        motion: columns and rows.
        covered: left, top, width and height of a rectangle [pixels].
        effects: noise and blur.
    """
    sheets = []
    for tag in layout.tags:
        if tag.body in poses:
            pose = poses[tag.body] @ tag.pose
            corners = square(SHEET * tag.size) @ pose.matrix.T + pose.position
            is_seen = pose.z_axis @ pose.position < 0
            back = np.full((2, 2), WHITE, np.uint8)
            sheets.append((corners, tag_texture(tag.id) if is_seen else back))
    image = LENS.picture(sheets)
    left, top, width, height = covered
    image[top : top + height, left : left + width] = BACKGROUND
    middle = max(motion)
    kernel = np.zeros((2 * middle + 1, 2 * middle + 1), np.float32)
    start = (middle - motion[0] // 2, middle - motion[1] // 2)
    end = (start[0] + motion[0], start[1] + motion[1])
    cv2.line(kernel, start, end, 1)
    return taken(cv2.filter2D(image, -1, kernel / kernel.sum()), **effects)


def errors(measured: Pose, true: Pose) -> tuple[float, float]:
    """Errors of position [mm] and rotation [deg]."""
    distance = 1000 * np.linalg.norm(measured.position - true.position)
    cosine = min(1.0, abs(measured.rotation @ true.rotation))
    return float(distance), float(np.degrees(2 * np.arccos(cosine)))
