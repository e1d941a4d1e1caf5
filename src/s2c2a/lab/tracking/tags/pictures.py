"""Pictures of tags by a given camera: for tests, studies and emulation.

An ideal picture has no distortion and is larger than that of the camera. A `Lens` makes
the camera's picture of it. `paint` needs no graphics; `lab.emulation.tag_camera` renders.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from jaxtyping import Float

from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags.camera import Board, CameraModel
from s2c2a.lab.tracking.tags.detection import tag_dictionary
from s2c2a.lab.tracking.tags.layout import CELLS, SHEET, Tag, TagLayout, square
from s2c2a.lab.tracking.tags.opencv import cv2

OVERSAMPLING = 2
BACKGROUND = 130  # gray value
WHITE = 225  # gray value of printed paper
BLACK = 25
CELL_PIXELS = 16  # of a texture


@dataclass(frozen=True)
class Effects:
    """What a real camera adds to a picture.

    Attributes:
        noise: standard deviation of the gray values.
        blur: standard deviation of a Gaussian blur [pixels].
        motion: columns and rows that the picture moves during the exposure.
        covered: rectangles (left, top, width, height) [pixels] that something hides.
        seed: of the noise.
    """

    noise: float = 0.0
    blur: float = 0.0
    motion: tuple[float, float] = (0.0, 0.0)
    covered: Sequence[tuple[int, int, int, int]] = ()
    seed: int = 0


class Lens:
    """Turns ideal pictures into those of a camera.

    Attributes:
        focal: focal length of the ideal picture [pixels].
        width: of the ideal picture [pixels].
        height: of the ideal picture [pixels].
    """

    def __init__(self, camera: CameraModel, oversampling: int = OVERSAMPLING):
        """Compute where every pixel of the camera looks.

        Args:
            camera: the model.
            oversampling: pixels of the ideal picture for one of the camera, along
                each axis.
        """
        self._camera = camera
        self._oversampling = oversampling
        self.focal = oversampling * max(camera.focal_lengths)
        rays = self._rays()
        extents = np.ceil(self.focal * np.abs(rays).max(axis=(0, 1))).astype(int) + 2
        self.width, self.height = (2 * extents).tolist()
        center = np.array([(self.width - 1) / 2, (self.height - 1) / 2])
        self._map = (self.focal * rays + center).astype(np.float32)

    def _rays(self) -> np.ndarray:
        """Undistorted x / z, y / z of all samples, shape (rows, columns, 2)."""
        camera = self._camera
        count = self._oversampling
        columns = (np.arange(count * camera.width) + 0.5) / count - 0.5
        rows = (np.arange(count * camera.height) + 0.5) / count - 0.5
        pixels = np.stack(np.meshgrid(columns, rows), axis=-1)
        rays = cv2.undistortPoints(
            pixels.reshape(-1, 1, 2), camera.matrix, camera.coefficients
        )
        return rays.reshape(pixels.shape)

    @property
    def field_height(self) -> float:
        """Vertical field of view of the ideal picture [rad]."""
        return 2 * math.atan(self.height / 2 / self.focal)

    @cached_property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """Intrinsic matrix of the ideal picture [pixels]."""
        column = (self.width - 1) / 2
        row = (self.height - 1) / 2
        return np.array([[self.focal, 0, column], [0, self.focal, row], [0, 0, 1.0]])

    def picture(self, ideal: np.ndarray, effects: Effects | None = None) -> np.ndarray:
        """Return the camera's picture.

        Args:
            ideal: 8 bit, shape (height, width) or (height, width, 3).
            effects: blur, noise, and what is hidden.
        """
        effects = effects or Effects()
        columns, rows = np.moveaxis(self._map, -1, 0)
        sampled = cv2.remap(ideal, columns, rows, cv2.INTER_LINEAR)
        size = (self._camera.width, self._camera.height)
        image = cv2.resize(sampled, size, interpolation=cv2.INTER_AREA)
        for left, top, width, height in effects.covered:
            image[top : top + height, left : left + width] = BACKGROUND
        return _with_noise(_blurred(image, effects), effects)


def _blurred(image: np.ndarray, effects: Effects) -> np.ndarray:
    length = math.hypot(*effects.motion)
    if length > 0:
        image = cv2.filter2D(image, -1, _motion_kernel(effects.motion))
    if effects.blur > 0:
        image = cv2.GaussianBlur(image, (0, 0), effects.blur)
    return image


def _motion_kernel(motion: tuple[float, float]) -> np.ndarray:
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


def _with_noise(image: np.ndarray, effects: Effects) -> np.ndarray:
    if effects.noise == 0:
        return image
    noise = np.random.default_rng(effects.seed).normal(0, effects.noise, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


@cache
def tag_texture(id: int) -> np.ndarray:
    """Return the picture of a tag with its white margin, 8 bit, square."""
    marker = cv2.aruco.generateImageMarker(tag_dictionary(), id, CELLS)
    cells = np.where(np.pad(marker, 1, constant_values=255) > 0, WHITE, BLACK)
    return np.kron(cells, np.ones((CELL_PIXELS, CELL_PIXELS))).astype(np.uint8)


def paint(
    lens: Lens, layout: TagLayout, poses: Mapping[str, Pose], seen: bool = True
) -> np.ndarray:
    """Return an ideal picture of tags, without anything else.

    Args:
        lens: of the camera.
        layout: of the tags.
        poses: `T_camera_body` by name; bodies without a pose are not painted.
        seen: whether tags that look away are left out.
    """
    image = np.full((lens.height, lens.width), BACKGROUND, np.uint8)
    placed = [
        (tag, poses[tag.body] @ tag.pose) for tag in layout.tags if tag.body in poses
    ]
    # the farthest first
    placed.sort(key=lambda pair: -float(np.linalg.norm(pair[1].position)))
    for tag, pose in placed:
        if not seen or pose.z_axis @ pose.position < 0:
            _paint_sheet(image, lens, _sheet(tag, pose), tag_texture(tag.id))
    return image


def _sheet(tag: Tag, pose: Pose) -> np.ndarray:
    """Corners of the paper, camera frame [m]."""
    return square(SHEET * tag.size) @ pose.matrix.T + pose.position


def _paint_sheet(
    image: np.ndarray, lens: Lens, corners: np.ndarray, texture: np.ndarray
) -> None:
    """Paint a picture onto a quadrilateral, unless it is behind the camera."""
    if corners[:, 2].min() <= 0.01:
        return
    projected = corners @ lens.matrix.T
    pixels = projected[:, :2] / projected[:, 2:]
    if np.abs(pixels).max() > 1e5:
        return
    right = texture.shape[1] - 0.5
    bottom = texture.shape[0] - 0.5
    source = np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])
    warp = cv2.getPerspectiveTransform(
        source.astype(np.float32), pixels.astype(np.float32)
    )
    cv2.warpPerspective(
        texture,
        warp,
        (image.shape[1], image.shape[0]),
        dst=image,
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_TRANSPARENT,
    )


def paint_board(
    lens: Lens, board: Board, texture: np.ndarray, pose: Pose
) -> np.ndarray:
    """Return an ideal picture of a calibration board.

    Args:
        lens: of the camera.
        board: its size.
        texture: picture of the board with a white margin of one square.
        pose: `T_camera_board` of the middle of the board: x right, y up, z toward the
            viewer.
    """
    image = np.full((lens.height, lens.width), BACKGROUND, np.uint8)
    half = board.square / 2 * np.array([board.columns + 2, board.rows + 2, 0])
    corners = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * half
    placed = corners @ pose.matrix.T + pose.position
    _paint_sheet(image, lens, placed, texture)
    return image
