"""Pictures of tags by a given camera.

An ideal picture has no distortion and is larger than that of the camera. A `Lens` makes
the camera's picture of it. Painting needs no graphics.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from jaxtyping import Float

from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags.camera import CameraModel
from s2c2a.lab.tracking.tags.detection import tag_dictionary
from s2c2a.lab.tracking.tags.layout import CELLS, SHEET, TagLayout, square
from s2c2a.lab.tracking.tags.opencv import cv2

OVERSAMPLING = 2
BACKGROUND = 130  # gray value
WHITE = 225  # gray value of printed paper
BLACK = 25
CELL_PIXELS = 8  # of a texture
_NEAREST = 0.01  # m; what is nearer to the camera is not painted


@dataclass(frozen=True)
class Effects:
    """What a real camera adds to a picture.

    Attributes:
        noise: standard deviation of the gray values.
        blur: standard deviation of a Gaussian blur [pixels].
        seed: of the noise.
    """

    noise: float = 0.0
    blur: float = 0.0
    seed: int = 0

    def on(self, image: np.ndarray) -> np.ndarray:
        """Return a picture, 8 bit, with these effects."""
        if self.blur > 0:
            image = cv2.GaussianBlur(image, (0, 0), self.blur)
        if self.noise == 0:
            return image
        noise = np.random.default_rng(self.seed).normal(0, self.noise, image.shape)
        return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


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

    @cached_property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """Intrinsic matrix of the ideal picture [pixels]."""
        column = (self.width - 1) / 2
        row = (self.height - 1) / 2
        return np.array([[self.focal, 0, column], [0, self.focal, row], [0, 0, 1.0]])

    def picture(self, ideal: np.ndarray, effects: Effects | None = None) -> np.ndarray:
        """Return the camera's picture.

        Args:
            ideal: 8 bit, shape (height, width).
            effects: blur and noise.
        """
        columns, rows = np.moveaxis(self._map, -1, 0)
        sampled = cv2.remap(ideal, columns, rows, cv2.INTER_LINEAR)
        size = (self._camera.width, self._camera.height)
        image = cv2.resize(sampled, size, interpolation=cv2.INTER_AREA)
        return (effects or Effects()).on(image)

    def project(self, points: np.ndarray) -> np.ndarray | None:
        """Return columns and rows in the ideal picture; None if it cannot show them.

        Args:
            points: camera frame [m], shape (points, 3).
        """
        if points[:, 2].min() <= _NEAREST:
            return None
        projected = points @ self.matrix.T
        pixels = projected[:, :2] / projected[:, 2:]
        return pixels if np.abs(pixels).max() <= 1e5 else None


@cache
def tag_texture(id: int) -> np.ndarray:
    """Return the picture of a tag with its white margin, 8 bit, square."""
    marker = cv2.aruco.generateImageMarker(tag_dictionary(), id, CELLS)
    cells = np.where(np.pad(marker, 1, constant_values=255) > 0, WHITE, BLACK)
    return np.kron(cells, np.ones((CELL_PIXELS, CELL_PIXELS))).astype(np.uint8)


def paint(lens: Lens, layout: TagLayout, poses: Mapping[str, Pose]) -> np.ndarray:
    """Return an ideal picture of the tags of all bodies that have a pose.

    Args:
        lens: of the camera.
        layout: of the tags.
        poses: `T_camera_body` by name.
    """
    canvas = Canvas(lens)
    for tag in layout.tags:
        if tag.body in poses:
            pose = poses[tag.body] @ tag.pose
            is_seen = pose.z_axis @ pose.position < 0
            corners = square(SHEET * tag.size) @ pose.matrix.T + pose.position
            canvas.paint(corners, tag_texture(tag.id) if is_seen else _plain(WHITE))
    return canvas.image


class Canvas:
    """An ideal picture on which what is nearer hides what is farther.

    Attributes:
        image: 8 bit, shape (height, width).
    """

    def __init__(self, lens: Lens):
        """A picture of nothing.

        Args:
            lens: of the camera.
        """
        self._lens = lens
        self.image = np.full((lens.height, lens.width), BACKGROUND, np.uint8)
        self._depths = np.full(self.image.shape, np.inf)

    def paint(self, corners: Float[np.ndarray, "4 3"], texture: np.ndarray) -> None:
        """Paint a picture onto a flat quadrilateral, unless it is behind the camera.

        Args:
            corners: from the upper left one clockwise, camera frame [m].
            texture: the picture, 8 bit.
        """
        pixels = self._lens.project(corners)
        if pixels is None:
            return
        left, top = np.maximum(np.floor(pixels.min(axis=0)).astype(int), 0)
        right, bottom = np.ceil(pixels.max(axis=0)).astype(int) + 1
        image = self.image[top : max(bottom, 0), left : max(right, 0)]
        if not image.size:
            return
        depths = self._depths[top : max(bottom, 0), left : max(right, 0)]
        shifted = (pixels - (left, top)).astype(np.float32)
        height, width = texture.shape
        source = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
        warp = cv2.getPerspectiveTransform(source.astype(np.float32), shifted)
        size = (image.shape[1], image.shape[0])
        edge = cv2.BORDER_REPLICATE
        painted = cv2.warpPerspective(texture, warp, size, borderMode=edge)
        inside = np.zeros(image.shape, np.uint8)
        cv2.fillConvexPoly(inside, np.rint(shifted).astype(np.int32), 1)
        # depths of a plane [m] in a part of the picture
        first, second, _, last = corners
        normal = np.cross(second - first, last - first)
        rows, columns = np.indices(image.shape) + np.array([top, left])[:, None, None]
        rays = np.stack([columns, rows, np.ones(image.shape)], axis=-1)
        slopes = rays @ np.linalg.inv(self._lens.matrix).T @ normal
        distances = normal @ first / np.where(slopes == 0, np.inf, slopes)
        nearer = (inside > 0) & (distances < depths)
        image[nearer] = painted[nearer]
        depths[nearer] = distances[nearer]


def _plain(gray: int) -> np.ndarray:
    return np.full((2, 2), gray, np.uint8)
