import importlib
import subprocess
import sys
import time

import numpy as np
import pytest
from painted_tags import CAMERA, LAYOUT, collar_pose, errors, picture
from streams import wait_until

from s2c2a.lab.tracking import ModuleEnds, TrackingError, receiving
from s2c2a.lab.tracking.tags import TagDropReason, TagTracker, save_camera, tag_tracker
from s2c2a.lab.tracking.tags.capture import open_device
from s2c2a.lab.tracking.tags.opencv import cv2

BASE = collar_pose((0, 0.06, 0.5), turn_deg=135, tilt_deg=0)
TIP = collar_pose((0, -0.06, 0.5), turn_deg=135, tilt_deg=0)
IMAGE = picture({"base": BASE, "end-1": TIP})


class FakeCamera:
    """Shows pictures; None stands for a camera that is lost."""

    def __init__(self, *images, then=IMAGE):
        self._images = list(images)
        self._then = then
        self.is_closed = False

    def read(self):
        time.sleep(0.005)
        image = self._images.pop(0) if self._images else self._then
        if isinstance(image, Exception):
            raise image
        return None if image is None else (image, time.perf_counter())

    def close(self):
        self.is_closed = True


def test_a_camera_gives_the_states_of_the_module_ends():
    with TagTracker(FakeCamera, CAMERA, LAYOUT) as tracker:
        wait_until(lambda: tracker.latest() is not None)
        frame = tracker.latest()
        assert tracker.problem == ""
        wait_until(lambda: tracker.latest().number > frame.number)
    assert tracker.latest().arrival_time > frame.arrival_time
    states = ModuleEnds.of(1).states(frame)
    true = BASE.inverse() @ TIP
    np.testing.assert_allclose(states[0, :3], true.position, atol=0.002)
    np.testing.assert_allclose(states[0, 3:], true.z_axis, atol=0.02)


def opening(*results):
    """Opens cameras, or raises errors, one after the other; the last one remains."""
    remaining = list(results)

    def open_camera():
        opened = remaining.pop(0) if remaining[1:] else remaining[0]
        if isinstance(opened, Exception):
            raise opened
        return opened

    return open_camera


@pytest.mark.parametrize("loss", [None, OSError("unplugged")])
def test_a_camera_that_was_lost_is_opened_again(monkeypatch, loss):
    monkeypatch.setattr(receiving, "FIRST_PAUSE", 0.001)
    monkeypatch.setattr(receiving, "LONGEST_PAUSE", 0.01)
    lost = FakeCamera(IMAGE, loss)
    closed = TrackingError("no camera")
    open_camera = opening(lost, closed, closed, FakeCamera())
    with TagTracker(open_camera, CAMERA, LAYOUT) as tracker:
        wait_until(lambda: tracker.counts.accepted >= 3)
        assert tracker.counts.restarts == 1
        assert tracker.problem == ""
    assert lost.is_closed


def test_a_camera_that_does_not_open_refuses_to_start_and_is_a_problem_later():
    closed = TrackingError("the camera 0 does not open")
    with pytest.raises(TrackingError, match="does not open"):
        TagTracker(opening(closed), CAMERA, LAYOUT).start()
    with TagTracker(opening(FakeCamera(None), closed), CAMERA, LAYOUT) as tracker:
        wait_until(lambda: "does not open" in tracker.problem)


def test_pictures_of_another_size_name_both_sizes():
    large = np.zeros((720, 1280, 3), np.uint8)
    with TagTracker(lambda: FakeCamera(then=large), CAMERA, LAYOUT) as tracker:
        wait_until(lambda: tracker.counts.dropped[TagDropReason.WRONG_SIZE])
        assert "1280 x 720" in tracker.problem
        assert "640 x 360" in tracker.problem
        assert tracker.latest() is None


@pytest.mark.parametrize("image", ["text", np.zeros(3), np.zeros((360, 640), bool)])
def test_nonsense_from_a_source_is_counted_and_does_not_end_the_thread(image):
    source = FakeCamera(image)
    with TagTracker(lambda: source, CAMERA, LAYOUT) as tracker:
        wait_until(lambda: tracker.latest() is not None)
    assert tracker.counts.dropped[TagDropReason.MALFORMED] == 1


def test_without_tags_the_problem_says_so():
    empty = np.full((360, 640), 128, np.uint8)
    with TagTracker(lambda: FakeCamera(then=empty), CAMERA, LAYOUT) as tracker:
        wait_until(lambda: tracker.latest() is not None)
        assert "no tag" in tracker.problem
        assert tracker.latest().poses == {}


def test_a_hidden_base_keeps_its_average():
    tip_only = picture({"end-1": TIP})
    source = FakeCamera(*[IMAGE] * 3, then=tip_only)
    with TagTracker(lambda: source, CAMERA, LAYOUT, average_base=True) as tracker:
        wait_until(lambda: tracker.counts.accepted > 5)
        frame = tracker.latest()
    assert errors(frame.poses["base"], BASE)[0] < 2


def test_files_give_a_tracker(tmp_path):
    save_camera(CAMERA, tmp_path / "camera.json")
    tracker = tag_tracker("0", tmp_path / "camera.json")
    assert tracker.latest() is None
    with pytest.raises(TrackingError, match="calibrate-camera"):
        tag_tracker("0", tmp_path / "absent.json")
    with pytest.raises(TrackingError, match="print-tags"):
        tag_tracker("0", tmp_path / "camera.json", tmp_path / "absent.json")


@pytest.mark.parametrize("device", ["no such device", "99999999999", "-1", "²"])
def test_a_device_that_does_not_exist_is_named(tmp_path, device):
    save_camera(CAMERA, tmp_path / "camera.json")
    with pytest.raises(TrackingError, match="camera"):
        tag_tracker(device, tmp_path / "camera.json").start()


def test_a_video_file_is_tracked_to_its_end(tmp_path):
    path = str(tmp_path / "arm.avi")
    code = cv2.VideoWriter.fourcc(*"MJPG")
    writer = cv2.VideoWriter(path, code, 100.0, (640, 360))
    for _ in range(3):
        writer.write(np.repeat(IMAGE[..., None], 3, axis=-1))
    writer.release()
    save_camera(CAMERA, tmp_path / "camera.json")
    with tag_tracker(path, tmp_path / "camera.json") as tracker:
        wait_until(lambda: "has ended" in tracker.problem)
        frame = tracker.latest()
    assert tracker.counts.accepted == 3
    assert errors(frame.poses["end-1"], TIP)[0] < 3


DYING = """
import os, sys
from s2c2a.lab.tracking.tags.decoder import HEADER
sys.stdout.buffer.write(HEADER.pack(100.0, 1, 1, 1) + b"x")
sys.stdout.flush()
{end}
"""


def replace_decoder(monkeypatch, program):
    monkeypatch.setattr(
        "s2c2a.lab.tracking.tags.decoding.child_command",
        lambda *_: [sys.executable, str(program)],
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "end", ["os.abort()", "sys.stdout.buffer.write(HEADER.pack(0.0, 10**9, 1, 1))"]
)
def test_a_video_that_ends_its_decoder_is_an_error_here(tmp_path, monkeypatch, end):
    (tmp_path / "dying.py").write_text(DYING.format(end=end))
    (tmp_path / "arm.avi").touch()
    replace_decoder(monkeypatch, tmp_path / "dying.py")
    source = open_device(str(tmp_path / "arm.avi"))
    with pytest.raises(TrackingError, match=r"arm\.avi is no video"):
        source.read()
    source.close()


def test_a_decoder_that_does_not_answer_is_ended(tmp_path, monkeypatch):
    (tmp_path / "endless.py").write_text("while True: pass")
    (tmp_path / "arm.avi").touch()
    replace_decoder(monkeypatch, tmp_path / "endless.py")
    monkeypatch.setattr("s2c2a.lab.tracking.tags.decoding.PATIENCE", 0.1)
    with pytest.raises(TrackingError, match=r"arm\.avi is no video"):
        open_device(str(tmp_path / "arm.avi"))


def test_a_module_in_the_current_folder_is_not_imported(tmp_path, monkeypatch):
    (tmp_path / "cv2.py").write_text("open('ran', 'w')")
    (tmp_path / "arm.avi").touch()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TrackingError):
        open_device("arm.avi")
    assert not (tmp_path / "ran").exists()


def test_without_opencv_the_error_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "cv2", None)
    monkeypatch.delitem(sys.modules, "s2c2a.lab.tracking.tags.opencv")
    with pytest.raises(TrackingError, match=r"\[camera\]"):
        importlib.import_module("s2c2a.lab.tracking.tags.opencv")


def test_pose_trackers_need_no_opencv():
    command = (
        "import sys, s2c2a.lab.tracking, s2c2a.cli.main; sys.exit('cv2' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", command], check=False).returncode == 0
