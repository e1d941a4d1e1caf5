"""Pictures of an arm with tags."""

import time

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.lab.emulation.tag_accuracy import measure_accuracy
from s2c2a.lab.emulation.tag_camera import TagCamera, look_at
from s2c2a.lab.tracking import ModuleEnds
from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags import CameraModel, TagLayout, TagTracker, estimate_poses
from s2c2a.lab.tracking.tags.layout import Tag
from s2c2a.lab.tracking.tags.pictures import Effects

CAMERA = CameraModel(
    width=640,
    height=360,
    focal_lengths=(560.0, 556.0),
    center=(325.0, 176.0),
    distortion=(0.05, -0.1, 0.001, -0.0005, 0.0),
)
LAYOUT = TagLayout.collars(1)
POSES = {
    "base": Pose(np.zeros(3), np.array([0, 0, 0, 1.0])),
    "end-1": Pose(np.array([0.02, 0.01, 0.2]), np.array([0.1, 0.0, 0.0, 0.995])),
}
VIEW = look_at((0.45, 0.35, 0.2), (0, 0, 0.1))
TAGS = TagCamera(CAMERA, LAYOUT, load_arm("twin_arm"))


def test_a_camera_that_looks_at_a_point_has_it_in_the_middle():
    target = VIEW.inverse() @ Pose(np.array([0, 0, 0.1]), np.array([0, 0, 0, 1.0]))
    assert np.allclose(target.position[:2], 0)
    assert target.position[2] > 0
    assert VIEW.matrix[2, 1] < 0  # y is down


def test_painted_tags_are_where_they_are_placed():
    found = estimate_poses(TAGS.picture(POSES, VIEW), CAMERA, LAYOUT)
    for name, pose in POSES.items():
        true = VIEW.inverse() @ pose
        assert np.linalg.norm(found.poses[name].position - true.position) < 5e-4
        assert abs(found.poses[name].rotation @ true.rotation) > np.cos(0.005)


@pytest.mark.parametrize(("share", "is_hidden"), [(-0.3, True), (0.4, False)])
def test_the_arm_hides_the_tags_behind_it_only(share, is_hidden):
    middle = np.array([0.01, 0.005, 0.1])  # of the arm
    facing = VIEW @ Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))
    tag = Tag(
        id=0,
        body="base",
        size=0.03,
        position=tuple(middle + share * (VIEW.position - middle)),
        rotation=tuple(facing.rotation),
    )
    tags = TagCamera(CAMERA, TagLayout(tags=(tag,)), load_arm("twin_arm"))
    found = estimate_poses(tags.picture(POSES, VIEW), CAMERA, TagLayout(tags=(tag,)))
    assert (not found.views) == is_hidden


def test_noise_repeats_with_its_seed():
    first, second = (TAGS.picture(POSES, VIEW, Effects(noise=3)) for _ in range(2))
    assert np.array_equal(first, second)


class PaintedCamera:
    """A source of pictures of a straight arm."""

    def read(self):
        now = time.perf_counter()
        return TAGS.picture(POSES, VIEW), now

    def close(self):
        pass


def test_a_tracker_follows_a_painted_camera():
    with TagTracker(PaintedCamera, CAMERA, LAYOUT) as tracker:
        end = time.monotonic() + 30
        while tracker.counts.accepted < 2 and time.monotonic() < end:
            time.sleep(0.01)
        frame = tracker.latest()
    states = ModuleEnds.of(1).states(frame)
    assert np.allclose(states[0, :3], POSES["end-1"].position, atol=1e-3)
    assert np.allclose(states[0, 3:], POSES["end-1"].z_axis, atol=0.01)


@pytest.mark.slow
def test_accuracy_counts_missing_and_wrong_poses():
    arm = load_arm("twin_arm")
    layout = TagLayout.collars(arm.module_count)
    camera = CameraModel.of_field(1280, 720, 60.0)
    (near, far) = measure_accuracy(arm, camera, layout, (0.5, 9.0), pictures=2)
    assert near.missing < 1
    assert np.nanmax(near.errors[:, 0]) < 0.005
    assert far.missing == 1
    assert far.wrong == 0
