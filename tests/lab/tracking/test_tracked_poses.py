"""Poses compose as rigid transforms, and reject what is none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from s2c2a.lab.tracking import Pose, PoseError

COORDINATES = st.floats(-10, 10)
QUATERNIONS = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(
    lambda values: np.linalg.norm(values) > 0.1
)
QUARTER_ABOUT_X = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])


@st.composite
def poses(draw):
    position = draw(st.lists(COORDINATES, min_size=3, max_size=3))
    quaternion = np.array(draw(QUATERNIONS))
    return Pose(np.array(position), quaternion / np.linalg.norm(quaternion))


def test_a_composed_pose_turns_the_second_position():
    first = Pose(np.array([1.0, 0.0, 0.0]), QUARTER_ABOUT_X)
    second = Pose(np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, 0.0, 1.0]))
    np.testing.assert_allclose((first @ second).position, [1, -2, 0], atol=1e-12)


@given(poses())
def test_a_pose_times_its_inverse_is_the_identity(pose):
    product = pose @ pose.inverse()
    np.testing.assert_allclose(product.position, 0, atol=1e-9)
    np.testing.assert_allclose(np.abs(product.rotation[3]), 1, atol=1e-9)


@given(poses(), poses(), poses())
def test_composition_is_associative(a, b, c):
    left, right = (a @ b) @ c, a @ (b @ c)
    np.testing.assert_allclose(left.position, right.position, atol=1e-9)
    np.testing.assert_allclose(left.z_axis, right.z_axis, atol=1e-9)


@given(poses(), poses())
def test_rotations_agree_with_those_of_scipy(a, b):
    turn = Rotation.from_quat(a.rotation) * Rotation.from_quat(b.rotation)
    np.testing.assert_allclose((a @ b).matrix, turn.as_matrix(), atol=1e-12)


def test_a_quaternion_within_one_percent_is_normalized():
    pose = Pose.measured([0, 0, 0], [0, 0, 0, 1.009])
    assert np.linalg.norm(pose.rotation) == 1.0


@pytest.mark.parametrize(
    ("position", "rotation"),
    [
        ([0, 0, np.nan], [0, 0, 0, 1]),
        ([0, 0], [0, 0, 0, 1]),
        (["a", 0, 0], [0, 0, 0, 1]),
        ([10**400, 0, 0], [0, 0, 0, 1]),
        ([0, 0, 100.1], [0, 0, 0, 1]),
        ([0, 0, 0], [0, 0, 0, 1.02]),
        ([0, 0, 0], [0, 0, 0, 0]),
        ([0, 0, 0], [0, 0, np.inf, 1]),
    ],
)
def test_an_impossible_pose_is_rejected(position, rotation):
    with pytest.raises(PoseError):
        Pose.measured(position, rotation)


def test_the_arrays_of_a_pose_cannot_change():
    with pytest.raises(ValueError, match="read-only"):
        Pose.identity().position[0] = 1.0
