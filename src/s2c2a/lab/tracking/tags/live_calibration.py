"""Calibration from a live camera or from a folder of pictures."""

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from s2c2a.errors import counted
from s2c2a.execution.progress import Progress
from s2c2a.lab.tracking.poses import TrackingError
from s2c2a.lab.tracking.tags.calibration import (
    MIN_VIEWS,
    BoardView,
    calibrate,
    calibrate_views,
    find_board,
    is_new_view,
    movement,
)
from s2c2a.lab.tracking.tags.camera import Board, CameraError, CameraModel
from s2c2a.lab.tracking.tags.capture import PictureSource, open_device
from s2c2a.lab.tracking.tags.decoding import DecodingProcess

MAX_VIEWS = 100
MAX_PICTURES = 500  # of a folder
MAX_BYTES = 50_000_000  # of a picture
MAX_REST = 0.003  # of the width of the picture; movement of a board that is held still
PATIENCE = 60.0  # s; without a new view
_PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


def calibrate_folder(folder: Path, board: Board) -> CameraModel:
    """Compute a camera model from the pictures of a folder.

    Raises:
        CameraError: there are no pictures, one is damaged, or they do not determine
            the camera.
    """
    paths = sorted(
        path for path in folder.iterdir() if path.suffix.lower() in _PICTURES
    )
    if not paths or len(paths) > MAX_PICTURES:
        raise CameraError(
            f"{folder} has {counted(len(paths), 'picture')} ({', '.join(_PICTURES)}); "
            f"give {MIN_VIEWS} to {MAX_PICTURES}"
        )
    return calibrate(read_pictures(paths), board)


def read_pictures(paths: Sequence[Path]) -> list[np.ndarray]:
    """Read pictures in gray, each of shape (height, width).

    Raises:
        CameraError: one is damaged or too large.
    """
    for path in paths:
        try:
            size = path.stat().st_size
        except OSError as error:
            raise CameraError(
                f"{path} cannot be read: {error}; leave it out"
            ) from error
        if size > MAX_BYTES:
            raise CameraError(f"{path} has more than {MAX_BYTES} bytes; leave it out")
    pictures = []
    decoder = DecodingProcess("pictures", paths)
    try:
        for path in paths:
            pictures.append(_decoded(decoder, path))
    finally:
        decoder.close()
    return pictures


def _decoded(decoder: DecodingProcess, path: Path) -> np.ndarray:
    try:
        image = decoder.read()
    except TrackingError as error:
        raise CameraError(f"{path} is damaged: {error}; leave it out") from error
    if image is None:
        raise CameraError(f"{path} is no picture; leave it out")
    return image.pixels


def calibrate_source(
    device: str,
    board: Board,
    count: int,
    resolution: tuple[int, int],
    progress: Progress,
) -> CameraModel:
    """Take pictures of a board that rests in new places, and compute the model.

    Args:
        device: see `open_device`.
        board: that is printed.
        count: of views.
        resolution: width and height [pixels].
        progress: called with the numbers of views taken and in all.

    Raises:
        CameraError: the count is not allowed, no new view comes for a minute, the
            camera is lost, or the views do not determine the camera.
    """
    if not MIN_VIEWS <= count <= MAX_VIEWS:
        raise CameraError(f"{counted(count, 'view')}; take {MIN_VIEWS} to {MAX_VIEWS}")
    source = open_device(device, *resolution)
    try:
        views, (height, width) = take_views(source, board, count, progress)
    finally:
        source.close()
    return calibrate_views(views, width, height, board)


def take_views(
    source: PictureSource, board: Board, count: int, progress: Progress
) -> tuple[list[BoardView], tuple[int, int]]:
    """Collect views of a board that rests in new places.

    Args:
        source: of the pictures.
        board: that is printed.
        count: of views.
        progress: called with the numbers of views taken and in all.

    Returns:
        The views, and height and width of the pictures.

    Raises:
        CameraError: no new view comes for a minute, or the camera is lost.
    """
    views: list[BoardView] = []
    before: BoardView | None = None
    shape = (0, 0)
    last = time.monotonic()
    progress("views", 0, count)
    while len(views) < count:
        picture = source.read()
        if picture is None or time.monotonic() - last > PATIENCE:
            raise CameraError(
                f"{len(views)} of {count} views were taken, then "
                + ("the camera gave no picture" if picture is None else "none came")
                + "; show the whole board, keep it still, then move it elsewhere"
            )
        image = picture[0]
        shape = image.shape[:2]
        view = find_board(image, board)
        if view is not None and before is not None:
            rests = movement(view, before) < MAX_REST * shape[1]
            if rests and is_new_view(view, views, shape[1]):
                views.append(view)
                last = time.monotonic()
                progress("views", len(views), count)
        before = view
    return views, shape
