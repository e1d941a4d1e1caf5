from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from s2c2a.arm import load_arm
from s2c2a.lab.tracking import Pose
from s2c2a.lab.tracking.arcs import ArcChain
from s2c2a.lab.tracking.frames import FrameError, HeldPoses, find_frames, mean_pose

ARM = load_arm("twin_arm")
BEND = 0.25


def pose(position, turn):
    return Pose(np.array(position), Rotation.from_rotvec(turn).as_quat())


BASE = pose([0.01, -0.02, 0.03], [0.3, 1.0, -0.5])
ENDS = (
    pose([0.02, 0.0, -0.01], [0.1, 0.2, 0.9]),
    pose([0.0, 0.03, 0.01], [-1.0, 0.2, 0.3]),
    pose([-0.02, 0.01, 0.02], [0.4, -0.7, 2.0]),
)
WORLD = pose([1.0, -0.5, 0.8], [0.2, -0.3, 0.7])


@pytest.fixture
def held():
    bends = np.zeros((13, 3, 2))
    for number in range(12):
        module, axis, side = np.unravel_index(number, (3, 2, 2))
        bends[number + 1, module, axis] = BEND * (1 - 2 * side)
    return [held_poses(one) for one in bends]


def held_poses(bends):
    """Poses of an arm whose bends are less than its encoders say."""
    positions, rotations = ArcChain.of(ARM).ends(0.9 * bends)
    ends = [
        WORLD @ Pose(position, rotation) @ offset.inverse()
        for position, rotation, offset in zip(
            positions, Rotation.from_matrix(rotations).as_quat(), ENDS, strict=True
        )
    ]
    return HeldPoses(bends, WORLD @ BASE.inverse(), tuple(ends))


def angle(first, second):
    return (first.inverse() @ second).rotation[3]


def test_offsets_are_found_although_bends_differ_from_the_encoders(held):
    found = find_frames(ARM, held)
    pairs = zip((found.base_offset, *found.end_offsets), (BASE, *ENDS), strict=True)
    for one, true in pairs:
        assert np.allclose(one.position, true.position, atol=6e-4)
        assert abs(angle(one, true)) > np.cos(2e-3)
    assert found.position_residuals.max() < 1e-4


def in_millimeters(pose):
    return Pose(1000 * pose.position, pose.rotation)


CHANGES = {
    "bodies are swapped": lambda one: replace(
        one, ends=(*one.ends[1::-1], one.ends[2])
    ),
    "send meters": lambda one: replace(
        one, base=in_millimeters(one.base), ends=tuple(map(in_millimeters, one.ends))
    ),
    # a mirrored order of the cables
    "that its bends define": lambda one: replace(one, bends=one.bends * [1.0, -1.0]),
    "the base body moves": lambda one: replace(one, base=one.ends[0]),
}


@pytest.mark.parametrize("words", CHANGES)
def test_wrong_poses_are_noticed(held, words):
    with pytest.raises(FrameError, match=words):
        find_frames(ARM, list(map(CHANGES[words], held)))


def test_few_configurations_are_refused(held):
    with pytest.raises(FrameError, match="4 configurations"):
        find_frames(ARM, held[:4])


def test_the_mean_ignores_the_signs_of_quaternions():
    turned = pose([0.0, 0.0, 1.0], [0.0, 0.0, 0.2])
    opposite = Pose(
        np.array([0.0, 0.0, 3.0]), -pose([0.0] * 3, [0.0, 0.0, 0.4]).rotation
    )
    mean = mean_pose([turned, opposite])
    expected = pose([0.0, 0.0, 2.0], [0.0, 0.0, 0.3])
    assert np.allclose(mean.position, expected.position)
    assert abs(angle(mean, expected)) > 1 - 1e-12
    with pytest.raises(FrameError, match="no pose to average"):
        mean_pose([])


def test_weight_moves_a_bent_module_towards_the_ground():
    bends = np.array([[0.4, 0.0], [0.0, 0.0], [0.0, 0.0]])
    chain = ArcChain.of(ARM)
    light = ArcChain(chain.lengths, 0 * chain.compliances, chain.weights)
    heavy_ends, _ = chain.ends(bends)
    light_ends, _ = light.ends(bends)
    assert (heavy_ends[:, 0] > light_ends[:, 0]).all()
