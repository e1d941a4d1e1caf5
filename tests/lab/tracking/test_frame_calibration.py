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
    arm_ends = [
        Pose(position, Rotation.from_matrix(rotation).as_quat())
        for position, rotation in zip(positions, rotations, strict=True)
    ]
    ends = [
        WORLD @ end @ offset.inverse()
        for end, offset in zip(arm_ends, ENDS, strict=True)
    ]
    return HeldPoses(bends, WORLD @ BASE.inverse(), tuple(ends))


def changed(held, change):
    return [HeldPoses(one.bends, one.base, tuple(change(one.ends))) for one in held]


def angle(first, second):
    return (first.inverse() @ second).rotation[3]


def test_offsets_are_found_although_bends_differ_from_the_encoders(held):
    found = find_frames(ARM, held)
    pairs = zip((found.base_offset, *found.end_offsets), (BASE, *ENDS), strict=True)
    for one, true in pairs:
        assert np.allclose(one.position, true.position, atol=6e-4)
        assert abs(angle(one, true)) > np.cos(2e-3)
    assert found.position_residuals.max() < 1e-4


def test_swapped_bodies_are_named(held):
    swapped = changed(held, lambda ends: (ends[1], ends[0], ends[2]))
    with pytest.raises(FrameError, match="bodies are swapped"):
        find_frames(ARM, swapped)


def test_millimeters_are_noticed(held):
    def to_millimeters(one):
        return Pose(1000 * one.position, one.rotation)

    scaled = [
        HeldPoses(
            one.bends, to_millimeters(one.base), tuple(map(to_millimeters, one.ends))
        )
        for one in held
    ]
    with pytest.raises(FrameError, match="send meters"):
        find_frames(ARM, scaled)


def test_a_mirrored_order_of_cables_is_noticed(held):
    mirrored = [
        HeldPoses(one.bends * np.array([1.0, -1.0]), one.base, one.ends) for one in held
    ]
    with pytest.raises(FrameError, match="that its bends define"):
        find_frames(ARM, mirrored)


def test_a_base_that_moves_is_refused(held):
    moving = [HeldPoses(one.bends, one.ends[0], one.ends) for one in held]
    with pytest.raises(FrameError, match="the base body moves"):
        find_frames(ARM, moving)


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


def test_a_mean_of_nothing_is_refused():
    with pytest.raises(FrameError, match="no pose to average"):
        mean_pose([])


def test_weight_moves_a_bent_module_towards_the_ground():
    bends = np.array([[0.4, 0.0], [0.0, 0.0], [0.0, 0.0]])
    chain = ArcChain.of(ARM)
    light = ArcChain(chain.lengths, 0 * chain.compliances, chain.weights)
    heavy_ends, _ = chain.ends(bends)
    light_ends, _ = light.ends(bends)
    assert (heavy_ends[:, 0] > light_ends[:, 0]).all()
