"""Tags in a picture: detection, and corners from lines through the edges of a tag."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from functools import cache

import numpy as np
from jaxtyping import Float

from s2c2a.lab.tracking.tags.layout import CELLS
from s2c2a.lab.tracking.tags.opencv import cv2
from s2c2a.lab.tracking.tracker import DropError

MIN_SIDE = 16.0  # pixels; two for each cell of a tag
MIN_CONTRAST = 25.0  # gray values between black and white
MAX_EDGE_WIDTH = 0.7  # cells; of the rise from black to white
MAX_EDGE_ERROR = 0.12  # cells; rms distance of an edge from a straight line
MAX_SHIFT = 0.6  # cells; of a corner by the refinement
# Profiles across an edge, in sides of a tag. Their ends are as far from the edge as from
# the next cells, so that blur brings little of either into black and white: at 1.5 m
# the median error of the position is 0.6 mm, and 6 mm with a reach of 0.72 cells.
_REACH = 0.58 / CELLS
_ACROSS = np.linspace(-_REACH, _REACH, 25)
_ALONG = np.linspace(0.09, 0.91, 24)
_LEVEL_SAMPLES = 3  # at each end of a profile
_REFINEMENTS = 2


class TagDropReason(Enum):
    """Reasons for which a picture, a tag or a body is dropped."""

    WRONG_SIZE = "picture: not of the size of the camera model"
    MALFORMED = "picture: not an image of 8-bit values"
    FAILED = "picture: failed in the tracker; please report it"
    UNKNOWN_TAG = "tag: not in the layout"
    DUPLICATE = "tag: its id occurs twice in the picture"
    TOO_SMALL = "tag: less than 16 pixels wide"
    FAINT = "tag: too little contrast"
    BLURRED = "tag: out of focus or moving"
    COVERED = "tag: partly covered or not flat"
    MISFIT = "tag: does not agree with the other tags, or body: with any pose"
    AMBIGUOUS = "body: two poses agree with the picture"
    IMPRECISE = "body: too far away or too oblique for a precise pose"


@dataclass(frozen=True, eq=False)
class TagView:
    """A tag in a picture.

    Attributes:
        id: of the tag.
        corners: column and row [pixels]: top left, top right, bottom right, bottom
            left of the tag as it is printed.
    """

    id: int
    corners: Float[np.ndarray, "4 2"]


@dataclass(frozen=True, eq=False)
class Detections:
    """Tags in a picture.

    Attributes:
        views: with refined corners.
        rough: blurred or partly covered tags, whose corners are within some pixels.
        dropped: numbers of tags that are not among the views, by reason.
    """

    views: list[TagView]
    rough: list[TagView]
    dropped: Counter[TagDropReason]


class TagError(DropError):
    """A tag, a body or a picture is dropped."""

    reason: TagDropReason

    def __init__(self, reason: TagDropReason, message: str = ""):
        super().__init__(message or reason.value, reason)


def detect_tags(gray: np.ndarray, known: Iterable[int]) -> Detections:
    """Detect tags and refine their corners.

    Args:
        gray: picture, 8 bit, shape (height, width).
        known: ids that may occur.
    """
    corners, ids, _ = _detector().detectMarkers(gray)
    found = [] if ids is None else np.ravel(ids).tolist()
    counts = Counter(found)
    known = set(known)
    result = Detections([], [], Counter())
    for id, quadrilateral in zip(found, corners, strict=True):
        points = np.asarray(quadrilateral, dtype=np.float64).reshape(4, 2)
        if id not in known:
            result.dropped[TagDropReason.UNKNOWN_TAG] += 1
        elif counts[id] > 1:
            result.dropped[TagDropReason.DUPLICATE] += 1
        else:
            try:
                refined = refine_corners(gray, points)
            except TagError as error:
                result.dropped[error.reason] += 1
                result.rough.append(TagView(id, points))
            else:
                result.views.append(TagView(id, refined))
    return result


@cache
def _detector():
    parameters = cv2.aruco.DetectorParameters()
    # small tags of a webcam: their perimeter over the width of the picture
    parameters.minMarkerPerimeterRate = 0.02
    parameters.adaptiveThreshWinSizeMax = 33
    # two wrong bits of 36 at most; the codes of the family differ in eleven
    parameters.errorCorrectionRate = 0.4
    return cv2.aruco.ArucoDetector(tag_dictionary(), parameters)


@cache
def tag_dictionary():
    """Return the tag family 36h11."""
    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)


def refine_corners(
    gray: np.ndarray, corners: Float[np.ndarray, "4 2"]
) -> Float[np.ndarray, "4 2"]:
    """Intersect straight lines through the four edges of a tag.

    The place of an edge is that of a step from black to white with the same integral
    over a profile across the edge, which a symmetric blur does not move.

    Args:
        gray: picture, 8 bit, shape (height, width).
        corners: within about half a cell [pixels].

    Raises:
        TagError: the tag is too small, faint, blurred or partly covered.
    """
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    if sides.min() < MIN_SIDE / 2 or sides.max() < MIN_SIDE:
        raise TagError(TagDropReason.TOO_SMALL)
    refined = corners
    for _ in range(_REFINEMENTS):
        unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
        homography = cv2.getPerspectiveTransform(unit, refined.astype(np.float32))
        profiles = _profiles(gray, homography)
        # gray values of black and white at the four edges
        black = profiles[:, :, :_LEVEL_SAMPLES].mean(axis=(1, 2))
        white = profiles[:, :, -_LEVEL_SAMPLES:].mean(axis=(1, 2))
        contrast = white - black
        if contrast.min() < MIN_CONTRAST:
            raise TagError(TagDropReason.FAINT)
        rises = (profiles - black[:, None, None]) / contrast[:, None, None]
        # compare the steepest slope of the mean profile of every edge with a step
        slopes = np.gradient(rises.mean(axis=1), _ACROSS, axis=1)
        widths = CELLS / np.maximum(slopes.max(axis=1), 1e-9)
        if widths.max() > MAX_EDGE_WIDTH:
            raise TagError(TagDropReason.BLURRED)
        # (edges, along), outward, in sides of the tag
        offsets = _REACH - np.trapezoid(rises, _ACROSS, axis=2)
        points = _map(homography, _edge_points(offsets))
        lines = [_fit_line(edge) for edge in points]
        along = np.stack([_ALONG, np.ones_like(_ALONG)], axis=1)
        fitted = np.linalg.lstsq(along, offsets.T, rcond=None)[0]
        residuals = offsets.T - along @ fitted
        errors = CELLS * np.sqrt(np.mean(residuals**2, axis=0))
        if errors.max() > MAX_EDGE_ERROR:
            raise TagError(TagDropReason.COVERED)
        refined = np.array(
            [_intersect(lines[edge - 1], lines[edge]) for edge in range(4)]
        )
    shift = np.linalg.norm(refined - corners, axis=1).max()
    # an oblique tag is only a few pixels wide, and its first corners are whole pixels
    if shift > max(MAX_SHIFT * sides.max() / CELLS, 1.5):
        raise TagError(TagDropReason.COVERED)
    return refined


def _edge_points(offsets: np.ndarray) -> np.ndarray:
    """Points beside the four edges of the unit square: top, right, bottom, left.

    Args:
        offsets: outward, shape (4, along) or (4, along, across).

    Returns:
        Points, shape (*offsets, 2).
    """
    along = _ALONG.reshape(-1, *(1,) * (offsets.ndim - 2))
    along = np.broadcast_to(along, offsets.shape[1:])
    top, right, bottom, left = offsets
    edges = [
        np.stack([along, -top], axis=-1),
        np.stack([1 + right, along], axis=-1),
        np.stack([1 - along, 1 + bottom], axis=-1),
        np.stack([-left, 1 - along], axis=-1),
    ]
    return np.stack(edges)


def _profiles(gray: np.ndarray, homography: np.ndarray) -> np.ndarray:
    """Gray values across the edges, from black to white: (edges, along, across)."""
    shape = (4, _ALONG.size, _ACROSS.size)
    points = _map(homography, _edge_points(np.broadcast_to(_ACROSS, shape)))
    positions = points.astype(np.float32).reshape(4, -1, 2)
    columns, rows = np.moveaxis(positions, -1, 0)
    border = cv2.BORDER_REPLICATE
    values = cv2.remap(gray, columns, rows, cv2.INTER_LINEAR, borderMode=border)
    return values.reshape(shape).astype(np.float64)


def _map(homography: np.ndarray, points: np.ndarray) -> np.ndarray:
    homogeneous = points @ homography[:, :2].T + homography[:, 2]
    return homogeneous[..., :2] / homogeneous[..., 2:]


def _fit_line(points: np.ndarray) -> np.ndarray:
    """Line (a, b, c) with a x + b y + c = 0 and the least squares of distances."""
    center = points.mean(axis=0)
    normal = np.linalg.svd(points - center)[2][1]
    return np.array([*normal, -normal @ center])


def _intersect(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    point = np.cross(first, second)
    if abs(point[2]) < 1e-6:
        raise TagError(TagDropReason.COVERED)
    return point[:2] / point[2]
