import numpy as np

from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags.base_average import MOVED_FRAMES, BaseAverage

ROTATION = np.array([0.5, 0.5, 0.5, 0.5])


def pose(x: float, sign: float = 1.0) -> Pose:
    return Pose(np.array([x, 0.0, 1.0]), sign * ROTATION)


def test_the_average_of_equal_rotations_of_either_sign_is_that_rotation():
    average = BaseAverage()
    average.update(pose(0.0))
    result = average.update(pose(0.002, sign=-1.0))
    assert np.allclose(result.position, [0.001, 0, 1])
    assert np.allclose(np.abs(result.rotation @ ROTATION), 1)


def test_one_wrong_pose_is_left_out():
    average = BaseAverage()
    assert average.update(None) is None
    average.update(pose(0.0))
    assert average.update(pose(0.1)) is None
    assert np.allclose(average.update(pose(0.0)).position, [0, 0, 1])
    assert average.restarts == 0


def test_a_moved_camera_begins_again():
    average = BaseAverage()
    average.update(pose(0.0))
    results = [average.update(pose(0.1)) for _ in range(MOVED_FRAMES)]
    assert results[:-1] == [None] * (MOVED_FRAMES - 1)
    assert np.allclose(results[-1].position, [0.1, 0, 1])
    assert average.restarts == 1
