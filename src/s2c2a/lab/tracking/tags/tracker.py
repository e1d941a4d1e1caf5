"""Tracker of tags in front of a webcam."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from threading import Event

import numpy as np

from s2c2a.lab.tracking.poses import Pose, TrackingError
from s2c2a.lab.tracking.receiving import ReceivingTracker
from s2c2a.lab.tracking.tags.base_average import BaseAverage
from s2c2a.lab.tracking.tags.camera import CameraModel, load_camera
from s2c2a.lab.tracking.tags.capture import Picture, PictureSource, opener
from s2c2a.lab.tracking.tags.detection import TagDropReason
from s2c2a.lab.tracking.tags.estimation import estimate_poses
from s2c2a.lab.tracking.tags.layout import BASE, MAX_MODULES, TagLayout, load_layout
from s2c2a.lab.tracking.tracker import PoseFrame

CONTINUITY_TIME = 0.3  # s; for which the previous pose of a body decides
SILENCE = 1.0  # s; without pictures, after which there is a problem


class TagTracker(ReceivingTracker):
    """Measures bodies that carry AprilTags, in the pictures of a camera.

    It opens the camera again when it was unplugged. The world frame is that of the
    camera (x right, y down, z forward). A body whose pose is not certain is absent from
    the poses.
    """

    drop_reasons = TagDropReason

    def __init__(
        self,
        open_camera: Callable[[], PictureSource],
        camera: CameraModel,
        layout: TagLayout,
        average_base: bool = False,
    ):
        """A tracker that does not receive yet.

        Args:
            open_camera: opens the source of the pictures.
            camera: its model.
            layout: of the tags.
            average_base: whether the base stands still before a camera that stands
                still: its pose is averaged, and kept while its tags are hidden.
        """
        self._open_camera = open_camera
        self._source: PictureSource | None = None
        self._camera = camera
        self._layout = layout
        self._average_base = average_base
        super().__init__()

    def _reset(self) -> None:
        super()._reset()
        self._base = BaseAverage()
        self._previous: dict[str, tuple[float, Pose]] = {}

    @property
    def problem(self) -> str:
        """Why no poses arrive; empty while they do."""
        latest = self._latest
        if self._fault:
            return self._fault
        if latest is None:
            return "no picture has arrived yet"
        if time.perf_counter() - latest.arrival_time > SILENCE:
            return f"no picture for more than {SILENCE:g} s; check the camera"
        if not latest.poses:
            return "no tag is recognized; check light, focus and distance"
        return ""

    def _open(self) -> None:
        self._source = self._open_camera()

    def _release(self) -> None:
        # the thread has taken it, unless it was stopped at once
        if self._source is not None:
            self._source.close()
        self._source = None

    def _packets(self, stop: Event) -> Iterator[tuple]:
        source = self._opened()
        try:
            while not stop.is_set():
                yield *_read(source), time.perf_counter()
        finally:
            # a camera that was unplugged may fail here, too
            with suppress(Exception):
                source.close()

    def _opened(self) -> PictureSource:
        """The camera that the start has opened, or the camera opened again."""
        source, self._source = self._source, None
        if source is not None:
            return source
        try:
            source = self._open_camera()
        # whatever a driver raises
        except Exception as error:
            raise TrackingError(str(error)) from error
        self._restarts += 1
        return source

    def _handle(self, content: np.ndarray, source: float, arrival: float) -> None:
        """Use a picture; its source is the time of its exposure."""
        recent = {
            name: pose
            for name, (seen, pose) in self._previous.items()
            if arrival - seen < CONTINUITY_TIME
        }
        found = estimate_poses(content, self._camera, self._layout, recent)
        for reason, count in found.dropped.items():
            self._dropped[reason] += count
        for name, pose in found.poses.items():
            self._previous[name] = (arrival, pose)
        poses = dict(found.poses)
        if self._average_base:
            moved = self._base.restarts
            average = self._base.update(poses.pop(BASE, None))
            self._restarts += self._base.restarts - moved
            if average is not None:
                poses[BASE] = average
        self._keep(PoseFrame(arrival, source, self._accepted, poses))


def _read(source: PictureSource) -> Picture:
    """Wait for the next picture, or raise `TrackingError`."""
    try:
        picture = source.read()
    # whatever a driver raises
    except Exception as error:
        raise TrackingError(
            f"the camera is lost ({error}); plug it in again"
        ) from error
    if picture is None:
        raise TrackingError("the camera is lost; plug it in again")
    return picture


def tag_tracker(
    device: str,
    camera_file: str | os.PathLike,
    layout_file: str | os.PathLike = "",
    average_base: bool = False,
) -> TagTracker:
    """Return a tracker by a camera and files.

    Args:
        device: number of a camera, path such as /dev/video0, or a video file.
        camera_file: of `s2c2a tracking calibrate-camera`.
        layout_file: of `s2c2a tracking print-tags`; by default collars of 64 mm with
            tags of 40 mm around the base and up to nine module ends, all with caps.
        average_base: see `TagTracker`.

    Raises:
        TrackingError: a file is missing or damaged.
    """
    camera = load_camera(camera_file)
    if str(layout_file):
        layout = load_layout(layout_file)
    else:
        names = [f"end-{module}" for module in range(1, MAX_MODULES + 1)]
        layout = TagLayout.collars(MAX_MODULES, caps=names)
    open_camera = opener(device, camera.width, camera.height)
    return TagTracker(open_camera, camera, layout, average_base)
