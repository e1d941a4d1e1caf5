"""Pictures of an arm with tags by a given camera: for tests, studies and emulation.

An ideal picture has no distortion and is larger than that of the camera. A `Lens` makes
the camera's picture of it. Painting needs no graphics.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property, partial
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags.camera import CameraModel
from s2c2a.lab.tracking.tags.detection import tag_dictionary
from s2c2a.lab.tracking.tags.layout import CELLS, SHEET, Tag, TagLayout, square
from s2c2a.lab.tracking.tags.opencv import cv2

OVERSAMPLING = 2
BACKGROUND = 130  # gray value
WHITE = 225  # gray value of printed paper
BLACK = 25
ARM = 75
CELL_PIXELS = 16  # of a texture
_ARM_POINTS = 9  # of a module
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


def paint(
    lens: Lens, layout: TagLayout, poses: Mapping[str, Pose], arm_radius: float = 0.0
) -> np.ndarray:
    """Return an ideal picture of tags and of the arm between the bodies.

    Args:
        lens: of the camera.
        layout: of the tags.
        poses: `T_camera_body` by name, from the base to the tip; bodies without a pose
            are not painted.
        arm_radius: of the arm [m]; 0 for none.
    """
    image = np.full((lens.height, lens.width), BACKGROUND, np.uint8)
    parts = []
    for tag in layout.tags:
        if tag.body in poses:
            pose = poses[tag.body] @ tag.pose
            parts.append((pose.position, partial(_paint_tag, image, lens, tag, pose)))
    if arm_radius:
        for ends in pairwise(_center_line(list(poses.values()))):
            draw = partial(_paint_segment, image, lens, np.stack(ends), arm_radius)
            parts.append((np.mean(ends, axis=0), draw))
    # the farthest first, so that what is nearer hides it
    for _, draw in sorted(parts, key=lambda part: -float(np.linalg.norm(part[0]))):
        draw()
    return image


def _paint_tag(image: np.ndarray, lens: Lens, tag: Tag, pose: Pose) -> None:
    """Paint a sheet of paper; its back is white."""
    corners = square(SHEET * tag.size) @ pose.matrix.T + pose.position
    if pose.z_axis @ pose.position < 0:
        paint_sheet(image, lens, corners, tag_texture(tag.id))
    elif (pixels := lens.project(corners)) is not None:
        cv2.fillConvexPoly(image, np.rint(pixels).astype(np.int32), WHITE)


def paint_sheet(
    image: np.ndarray, lens: Lens, corners: np.ndarray, texture: np.ndarray
) -> None:
    """Paint a picture onto a quadrilateral, unless it is behind the camera.

    Args:
        image: ideal picture.
        lens: of the camera.
        corners: from the upper left one clockwise, camera frame [m], shape (4, 3).
        texture: the picture, 8 bit.
    """
    pixels = lens.project(corners)
    if pixels is None:
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


def _paint_segment(
    image: np.ndarray, lens: Lens, ends: np.ndarray, radius: float
) -> None:
    pixels = lens.project(ends)
    if pixels is not None:
        width = max(round(2 * radius * lens.focal / ends[:, 2].mean()), 1)
        start, end = np.rint(pixels).astype(int).tolist()
        cv2.line(image, start, end, ARM, width)


def _center_line(poses: list[Pose]) -> np.ndarray:
    """Points of cubic curves through poses along their z axes [m], shape (points, 3)."""
    if len(poses) < 2:
        return np.empty((0, 3))
    shares = np.linspace(0, 1, _ARM_POINTS)[:, None]
    curves = []
    for start, end in pairwise(poses):
        length = np.linalg.norm(end.position - start.position)
        difference = end.position - start.position
        cubic = shares**2 * (3 - 2 * shares) * difference
        outgoing = shares * (1 - shares) ** 2 * length * start.z_axis
        incoming = shares**2 * (shares - 1) * length * end.z_axis
        curves.append(start.position + cubic + outgoing + incoming)
    return np.concatenate(curves)
