from functools import cache

import numpy as np
import pytest
from painted_tags import Lens, taken
from scipy.spatial.transform import Rotation

from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags import Board, CameraModel, calibrate, find_board
from s2c2a.lab.tracking.tags.calibration import board_picture
from s2c2a.lab.tracking.tags.camera import CameraError
from s2c2a.lab.tracking.tags.live_calibration import calibrate_folder, take_views
from s2c2a.lab.tracking.tags.opencv import cv2

BOARD = Board()
CAMERA = CameraModel(
    width=640,
    height=480,
    focal_lengths=(530.0, 526.0),
    center=(325.0, 236.0),
    distortion=(0.06, -0.12, 0.001, -0.0005, 0.0),
)


def board_corners(pose: Pose) -> np.ndarray:
    """Corners of the board with a white margin of one square [m]."""
    half = BOARD.square / 2 * np.array([BOARD.columns + 2, BOARD.rows + 2, 0])
    corners = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * half
    return corners @ pose.matrix.T + pose.position


@cache
def pictures(count: int = 14) -> list[np.ndarray]:
    random = np.random.default_rng(3)
    lens = Lens(CAMERA)
    texture = board_picture(BOARD, 40)
    images = []
    for number in range(count):
        depth = random.uniform(0.28, 0.5)
        place = random.uniform(-1, 1, 2) * (0.28 * depth, 0.2 * depth)
        tilt = random.uniform(-0.6, 0.6, 3)
        facing = Rotation.from_euler("x", np.pi)
        rotation = Rotation.from_rotvec(tilt) * facing
        pose = Pose(np.array([*place, depth]), rotation.as_quat())
        image = lens.picture([(board_corners(pose), texture)])
        images.append(taken(image, seed=number))
    return images


@pytest.fixture(scope="module")
def calibrated() -> CameraModel:
    return calibrate(pictures(), BOARD)


def test_calibration_recovers_the_camera(calibrated):
    assert calibrated.focal_lengths == pytest.approx(CAMERA.focal_lengths, rel=0.005)
    assert calibrated.center == pytest.approx(CAMERA.center, abs=3)
    assert calibrated.rms < 0.3
    assert (calibrated.width, calibrated.height) == (640, 480)
    assert calibrated.board == BOARD


def test_calibration_recovers_where_points_appear(calibrated):
    grid = np.stack(np.meshgrid([-0.4, 0, 0.4], [-0.3, 0, 0.3]), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid, np.ones(len(grid))])
    zero = np.zeros(3)
    true, _ = cv2.projectPoints(points, zero, zero, CAMERA.matrix, CAMERA.coefficients)
    found, _ = cv2.projectPoints(
        points, zero, zero, calibrated.matrix, calibrated.coefficients
    )
    # a shift of the center is a rotation of the camera
    shift = np.mean(found - true, axis=0)
    assert np.abs(found - true - shift).max() < 1.5


@pytest.mark.parametrize(("columns", "rows"), [(7, 5), (6, 9), (5, 4)])
def test_the_picture_of_a_board_is_that_of_opencv(columns, rows):
    board = Board(columns=columns, rows=rows, square=0.04, marker=0.03)
    inner = board_picture(board, 40)[40:-40, 40:-40]
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    theirs = cv2.aruco.CharucoBoard((columns, rows), 0.04, 0.03, family)
    expected = theirs.generateImage((40 * columns, 40 * rows))
    # rounding of the markers' edges
    assert np.mean(inner != expected) < 0.03


@pytest.mark.parametrize("ratio", [0.45, 0.6, 0.743, 0.9])
def test_a_board_is_found_whatever_the_size_of_its_markers(ratio):
    board = Board(marker=ratio * 0.035)
    assert len(find_board(board_picture(board, 60), board).points) == 24


def test_pictures_that_do_not_suffice_are_refused():
    first, second, third, *_ = pictures()
    for images, words in [
        ([first, second, third], "3 show the board"),
        ([first] * 12, "1 of them in different places"),
        ([first, second[:400]], "2 sizes"),
        ([np.zeros((480, 640), np.uint8)] * 12, "0 show the board"),
    ]:
        with pytest.raises(CameraError, match=words):
            calibrate(images, BOARD)


def test_another_board_is_not_found_or_does_not_fit():
    other = Board(columns=6, rows=9)
    with pytest.raises(CameraError):
        calibrate(pictures(), other)


def test_a_folder_of_pictures_gives_a_camera(tmp_path, calibrated):
    for number, image in enumerate(pictures()):
        cv2.imwrite(str(tmp_path / f"{number:02}.png"), image)
    camera = calibrate_folder(tmp_path, BOARD)
    assert camera.focal_lengths == pytest.approx(calibrated.focal_lengths, rel=1e-3)


class ScriptedCamera:
    def __init__(self, images):
        self._images = list(images)

    def read(self):
        return (self._images.pop(0), 0.0) if self._images else None

    def close(self):
        pass


def test_views_are_taken_where_the_board_rests_in_a_new_place():
    done = []
    twice = [image for image in pictures()[:4] for _ in range(2)]
    camera = ScriptedCamera(twice)
    views, shape = take_views(camera, BOARD, 3, lambda *step: done.append(step))
    assert len(views) == 3
    assert shape == (480, 640)
    assert done[-1] == ("views", 3, 3)


def test_a_board_in_motion_gives_no_view():
    with pytest.raises(CameraError, match="0 of 3 views"):
        take_views(ScriptedCamera(pictures()[:6]), BOARD, 3, lambda *_: None)
