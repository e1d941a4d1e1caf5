"""Camera models from pictures of a printed ChArUco board; pure functions."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float

from s2c2a.errors import counted
from s2c2a.lab.tracking.tags.camera import DISTORTIONS, Board, CameraError, CameraModel
from s2c2a.lab.tracking.tags.opencv import cv2

MIN_VIEWS = 10
MIN_CORNERS = 8  # of a board in a picture
MIN_MOVE = 0.08  # of the width of the picture; between two views
MIN_COVERAGE = 0.5  # share of the picture
GOOD_RMS = 0.5  # pixels
MAX_RMS = 1.5  # pixels
MAX_FOCAL_STD = 0.01  # of the focal length
_GRID = 4  # cells along each side of the picture, for the coverage


@dataclass(frozen=True, eq=False)
class BoardView:
    """Corners of a board in a picture.

    Attributes:
        points: on the board [m], shape (corners, 3).
        pixels: in the picture, column and row, shape (corners, 2).
        outline: corners of the whole board in the picture, as a plane without
            distortion [pixels], shape (4, 2).
    """

    points: Float[np.ndarray, "corners 3"]
    pixels: Float[np.ndarray, "corners 2"]
    outline: Float[np.ndarray, "4 2"]


def board_picture(board: Board, square_pixels: int) -> np.ndarray:
    """Return the picture of a board with a white margin of one square, 8 bit.

    OpenCV's own picture fails for some sizes of markers and squares.
    """
    count = square_pixels
    height = count * (board.rows + 2)
    width = count * (board.columns + 2)
    picture = np.full((height, width), 255)
    side = round(count * board.marker / board.square)
    margin = (count - side) // 2
    id = 0
    for row, column in np.ndindex(board.rows, board.columns):
        top = count * (row + 1)
        left = count * (column + 1)
        if (row + column) % 2 == 0:
            picture[top : top + count, left : left + count] = 0
            continue
        marker = cv2.aruco.generateImageMarker(_markers(), id, side)
        top += margin
        left += margin
        picture[top : top + side, left : left + side] = marker
        id += 1
    return picture.astype(np.uint8)


@cache
def _markers():
    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)


@cache
def _charuco(board: Board):
    size = (board.columns, board.rows)
    return cv2.aruco.CharucoBoard(size, board.square, board.marker, _markers())


@cache
def _detector(board: Board):
    return cv2.aruco.CharucoDetector(_charuco(board))


def find_board(image: np.ndarray, board: Board) -> BoardView | None:
    """Find the corners of a board; None if too few are visible.

    Args:
        image: 8 bit, shape (height, width) or (height, width, 3).
        board: that is printed.
    """
    gray = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    corners, ids, _, _ = _detector(board).detectBoard(gray)
    if ids is None or len(ids) < MIN_CORNERS:
        return None
    points, pixels = _charuco(board).matchImagePoints(corners, ids)
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    pixels = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
    homography, _ = cv2.findHomography(points[:, :2], pixels)
    if homography is None:
        return None
    right = board.columns * board.square
    bottom = board.rows * board.square
    outline = np.array(
        [
            [[0, 0]],
            [[right, 0]],
            [[right, bottom]],
            [[0, bottom]],
        ]
    )
    mapped = cv2.perspectiveTransform(outline.astype(np.float64), homography)
    return BoardView(points, pixels, mapped.reshape(4, 2))


def movement(view: BoardView, other: BoardView) -> float:
    """Return the largest distance between the outlines of two views [pixels]."""
    distances = np.linalg.norm(view.outline - other.outline, axis=1)
    return float(distances.max())


def is_new_view(view: BoardView, views: Sequence[BoardView], width: int) -> bool:
    """Return whether a view differs enough from all others to add information.

    Args:
        view: to judge.
        views: that are there.
        width: of the pictures [pixels].
    """
    return all(movement(view, other) > MIN_MOVE * width for other in views)


def coverage(views: Sequence[BoardView], width: int, height: int) -> float:
    """Return the share of the picture that corners of the views cover, 0 to 1."""
    if not views:
        return 0.0
    pixels = np.concatenate([view.pixels for view in views])
    cells = np.floor(_GRID * pixels / (width, height)).astype(int)
    occupied = np.unique(np.clip(cells, 0, _GRID - 1), axis=0)
    return len(occupied) / _GRID**2


def calibrate(images: Sequence[np.ndarray], board: Board | None = None) -> CameraModel:
    """Compute a camera model from pictures of a board.

    Args:
        images: 8 bit, all of one size.
        board: that is printed; the default board if None.

    Raises:
        CameraError: the pictures are too few or too similar, differ in size, or do not
            determine the camera.
    """
    board = board or Board()
    sizes = {image.shape[:2] for image in images}
    if len(sizes) != 1:
        raise CameraError(
            f"pictures of {len(sizes)} sizes; take all with one camera and one size"
        )
    ((height, width),) = sizes
    found = [find_board(image, board) for image in images]
    views: list[BoardView] = []
    for view in found:
        if view is not None and is_new_view(view, views, width):
            views.append(view)
    shown = sum(view is not None for view in found)
    if len(views) < MIN_VIEWS:
        raise CameraError(
            f"{counted(len(images), 'picture')}: {shown} show the board, {len(views)} "
            f"of them in different places; take at least {MIN_VIEWS}: near, far, "
            "tilted, in the corners of the picture"
        )
    return calibrate_views(views, width, height, board)


def calibrate_views(
    views: Sequence[BoardView], width: int, height: int, board: Board
) -> CameraModel:
    """Compute a camera model from views of a board.

    Args:
        views: that differ.
        width: of the pictures [pixels].
        height: of the pictures [pixels].
        board: that is printed.

    Raises:
        CameraError: the views do not determine the camera.
    """
    covered = coverage(views, width, height)
    if covered < MIN_COVERAGE:
        raise CameraError(
            f"the board covers {covered:.0%} of the picture; take pictures with the "
            f"board in the corners, too, at least {MIN_COVERAGE:.0%}"
        )
    rms, matrix, distortion, deviations = _solve(views, width, height)
    focal_std = float(deviations[:2].max() / matrix[0, 0])
    if not rms <= MAX_RMS or not focal_std <= MAX_FOCAL_STD:
        raise CameraError(
            f"the calibration has an rms error of {rms:.2f} pixels and knows the focal "
            f"length within {focal_std:.1%}; at most {MAX_RMS} pixels and "
            f"{MAX_FOCAL_STD:.0%} are allowed: keep the board flat and still, and tilt "
            "it by about 40 degrees in some pictures"
        )
    try:
        return CameraModel(
            width=width,
            height=height,
            focal_lengths=(float(matrix[0, 0]), float(matrix[1, 1])),
            center=(float(matrix[0, 2]), float(matrix[1, 2])),
            distortion=tuple(float(value) for value in distortion[:DISTORTIONS]),
            rms=rms,
            views=len(views),
            board=board,
        )
    except ValueError as error:
        raise CameraError(
            f"the calibration gives no plausible camera: {error}; take new pictures"
        ) from error


def _solve(
    views: Sequence[BoardView], width: int, height: int
) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Error, matrix, distortion, and standard deviations of the intrinsics."""
    try:
        rms, matrix, distortion, _, _, deviations, *_ = cv2.calibrateCameraExtended(
            [view.points.astype(np.float32) for view in views],
            [view.pixels.astype(np.float32) for view in views],
            (width, height),
            np.eye(3),
            np.zeros(DISTORTIONS),
            # the sixth power is not determined by a webcam's field of view
            flags=cv2.CALIB_FIX_K3,
        )
    except cv2.error as error:
        raise CameraError(
            f"the calibration fails: {error.err}; take new pictures of the flat board"
        ) from error
    return float(rms), matrix, np.ravel(distortion), np.ravel(deviations)
