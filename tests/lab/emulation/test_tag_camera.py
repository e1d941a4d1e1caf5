"""Rendered pictures; skipped on computers without graphics."""

import time

import numpy as np
import pytest

from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation import tag_camera
from s2c2a.lab.emulation.tag_camera import TagScene, look_at
from s2c2a.lab.tracking import ModuleEnds
from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags import CameraModel, TagLayout, TagTracker, estimate_poses
from s2c2a.lab.tracking.tags.pictures import Effects, paint

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


@pytest.fixture(scope="module")
def scene():
    try:
        opened = TagScene(CAMERA, LAYOUT)
    except S2C2AError as error:
        pytest.skip(str(error))
    yield opened
    opened.close()


def test_a_camera_that_looks_at_a_point_has_it_in_the_middle():
    target = VIEW.inverse() @ Pose(np.array([0, 0, 0.1]), np.array([0, 0, 0, 1.0]))
    assert np.allclose(target.position[:2], 0)
    assert target.position[2] > 0
    assert VIEW.matrix[2, 1] < 0  # y is down


def test_rendered_tags_are_where_they_are_placed(scene):
    found = estimate_poses(scene.render(POSES, VIEW), CAMERA, LAYOUT)
    for name, pose in POSES.items():
        true = VIEW.inverse() @ pose
        assert np.linalg.norm(found.poses[name].position - true.position) < 5e-4
        assert abs(found.poses[name].rotation @ true.rotation) > np.cos(0.005)


def test_the_rendered_and_the_painted_picture_agree(scene):
    in_camera = {name: VIEW.inverse() @ pose for name, pose in POSES.items()}
    painted = scene.lens.picture(paint(scene.lens, LAYOUT, in_camera))
    rendered = scene.render(POSES, VIEW)[..., 0]
    is_ink = painted < 60
    assert is_ink.sum() > 1000
    assert np.abs(rendered[is_ink].astype(int) - painted[is_ink]).mean() < 5


def test_noise_repeats_with_its_seed(scene):
    first, second = (scene.render(POSES, VIEW, Effects(noise=3)) for _ in range(2))
    assert np.array_equal(first, second)


class RenderedCamera:
    """A source of pictures of a straight arm; a scene belongs to one thread."""

    def __init__(self):
        self._scene = None

    def read(self):
        self._scene = self._scene or TagScene(CAMERA, LAYOUT)
        now = time.perf_counter()
        return self._scene.render(POSES, VIEW), now

    def close(self):
        if self._scene is not None:
            self._scene.close()
        self._scene = None


def test_a_tracker_follows_a_rendered_camera(scene):
    with TagTracker(RenderedCamera, CAMERA, LAYOUT) as tracker:
        end = time.monotonic() + 30
        while tracker.counts.accepted < 2 and time.monotonic() < end:
            time.sleep(0.01)
        frame = tracker.latest()
    states = ModuleEnds.of(1).states(frame)
    assert np.allclose(states[0, :3], POSES["end-1"].position, atol=1e-3)
    assert np.allclose(states[0, 3:], POSES["end-1"].z_axis, atol=0.01)


def test_a_closed_scene_says_so():
    try:
        closed = TagScene(CAMERA, LAYOUT)
    except S2C2AError as error:
        pytest.skip(str(error))
    closed.close()
    closed.close()
    with pytest.raises(S2C2AError, match="closed"):
        closed.render(POSES, VIEW)


def test_without_graphics_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setattr(tag_camera, "_CONTEXTS", {})
    monkeypatch.setattr(tag_camera, "_OTHER_CONTEXTS", ("no_such_graphics",))
    with pytest.raises(S2C2AError, match="EGL"):
        TagScene(CAMERA, LAYOUT)
