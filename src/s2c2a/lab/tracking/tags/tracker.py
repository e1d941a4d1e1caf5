"""Tracker of tags in front of a webcam."""

import os
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Event, Thread

import numpy as np

from s2c2a.lab.tracking.poses import Pose
from s2c2a.lab.tracking.tags.base_average import BaseAverage
from s2c2a.lab.tracking.tags.camera import CameraModel, load_camera
from s2c2a.lab.tracking.tags.capture import PictureSource, opener
from s2c2a.lab.tracking.tags.detection import TagDropReason, TagError
from s2c2a.lab.tracking.tags.estimation import estimate_poses
from s2c2a.lab.tracking.tags.layout import (
    BASE,
    MAX_MODULES,
    TagLayout,
    load_layout,
)
from s2c2a.lab.tracking.tracker import PoseFrame, Tracker

CONTINUITY_TIME = 0.3  # s; for which the previous pose of a body decides
SILENCE = 1.0  # s; without pictures, after which there is a problem
FIRST_PAUSE = 0.1  # s; before the camera is opened again
LONGEST_PAUSE = 3.0  # s
CLOSE_TIME = 3.0  # s; a driver that hangs is left to its thread
RATE_PICTURES = 60  # for the measured rate


@dataclass(frozen=True)
class TagCounts:
    """Numbers since the tracker started.

    Attributes:
        accepted: pictures that became frames.
        dropped: pictures, tags and bodies by reason; every reason is present.
        restarts: of the camera, and of the average of the base.
    """

    accepted: int
    dropped: Mapping[TagDropReason, int]
    restarts: int


class TagTracker(Tracker):
    """Measures bodies that carry AprilTags, in the pictures of a camera.

    A thread waits for pictures and opens the camera again when it was unplugged. The
    world frame is that of the camera (x right, y down, z forward). A body whose pose
    is not certain is absent from the poses.
    """

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
        self._camera = camera
        self._layout = layout
        self._average_base = average_base
        self._thread: Thread | None = None
        self._stop = Event()
        self._reset()

    def _reset(self) -> None:
        self._latest: PoseFrame | None = None
        self._base = BaseAverage()
        self._previous: dict[str, tuple[float, Pose]] = {}
        self._arrivals: deque[float] = deque(maxlen=RATE_PICTURES)
        self._fault = ""
        self._accepted = 0
        self._restarts = 0
        self._dropped = dict.fromkeys(TagDropReason, 0)

    @property
    def counts(self) -> TagCounts:
        """Numbers of accepted and dropped pictures, tags and bodies."""
        restarts = self._restarts + self._base.restarts
        return TagCounts(self._accepted, self._dropped.copy(), restarts)

    @property
    def rate(self) -> float:
        """Measured rate of the frames [Hz]; zero before the second."""
        arrivals = list(self._arrivals)
        if len(arrivals) < 2 or time.perf_counter() - arrivals[-1] > SILENCE:
            return 0.0
        return (len(arrivals) - 1) / max(arrivals[-1] - arrivals[0], 1e-9)

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

    def start(self) -> None:
        """See `Tracker`.

        Raises:
            TrackingError: the camera does not open.
        """
        if self._thread is not None:
            return
        source = self._open_camera()
        self._reset()
        self._stop = Event()
        self._thread = Thread(
            target=self._receive,
            args=(source, self._stop),
            name="tag-tracker",
            daemon=True,
        )
        self._thread.start()

    def latest(self) -> PoseFrame | None:
        """See `Tracker`."""
        return self._latest

    def close(self) -> None:
        """See `Tracker`."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(CLOSE_TIME)
        self._thread = None

    def _receive(self, source: PictureSource | None, stop: Event) -> None:
        pause = FIRST_PAUSE
        while not stop.is_set():
            if source is None:
                stop.wait(pause)
                pause = min(2 * pause, LONGEST_PAUSE)
                source = self._reopen(stop)
            elif self._receive_one(source, stop):
                pause = FIRST_PAUSE
            else:
                self._fault = "the camera is lost; plug it in again"
                _close(source)
                source = None
        if source is not None:
            _close(source)

    def _reopen(self, stop: Event) -> PictureSource | None:
        if stop.is_set():
            return None
        try:
            source = self._open_camera()
        # whatever a driver raises: the thread outlives every failure
        except Exception as error:
            self._fault = str(error)
            return None
        self._restarts += 1
        return source

    def _receive_one(self, source: PictureSource, stop: Event) -> bool:
        """Use one picture; False if the camera is lost."""
        try:
            picture = source.read()
        except Exception:
            self._dropped[TagDropReason.FAILED] += 1
            return False
        if picture is None:
            return False
        # a tracker that was started again has another event and other counts
        if stop.is_set():
            return True
        try:
            self._handle(*picture, time.perf_counter())
        except TagError as error:
            self._dropped[error.reason] += 1
            self._fault = self._describe(error.reason, picture[0])
        except Exception:
            self._dropped[TagDropReason.FAILED] += 1
            self._fault = TagDropReason.FAILED.value
        return True

    def _describe(self, reason: TagDropReason, image: np.ndarray) -> str:
        if reason is not TagDropReason.WRONG_SIZE:
            return reason.value
        height, width = image.shape[:2]
        return (
            f"the pictures have {width} x {height} pixels, the camera model "
            f"{self._camera.width} x {self._camera.height}; calibrate with the size "
            "that is used"
        )

    def _handle(self, image: np.ndarray, exposure: float, arrival: float) -> None:
        """Make the poses of a picture the latest frame, or raise `TagError`."""
        found = estimate_poses(
            image, self._camera, self._layout, self._recent_poses(arrival)
        )
        for reason, count in found.dropped.items():
            self._dropped[reason] += count
        for name, pose in found.poses.items():
            self._previous[name] = (arrival, pose)
        poses = dict(found.poses)
        if self._average_base:
            self._replace_base(poses)
        self._latest = PoseFrame(arrival, exposure, self._accepted, poses)
        self._arrivals.append(arrival)
        self._accepted += 1
        self._fault = ""

    def _recent_poses(self, now: float) -> dict[str, Pose]:
        return {
            name: pose
            for name, (seen, pose) in self._previous.items()
            if now - seen < CONTINUITY_TIME
        }

    def _replace_base(self, poses: dict[str, Pose]) -> None:
        average = self._base.update(poses.pop(BASE, None))
        if average is not None:
            poses[BASE] = average


def _close(source: PictureSource) -> None:
    try:
        source.close()
    # a camera that was unplugged may fail here, too
    except Exception:
        return


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
        layout = _any_collars()
    open_camera = opener(device, camera.width, camera.height)
    return TagTracker(open_camera, camera, layout, average_base)


def _any_collars() -> TagLayout:
    names = [f"end-{module}" for module in range(1, MAX_MODULES + 1)]
    return TagLayout.collars(MAX_MODULES, caps=names)
