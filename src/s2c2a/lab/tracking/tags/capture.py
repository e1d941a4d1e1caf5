"""Sources of pictures: webcams and video files."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import numpy as np

from s2c2a.lab.tracking.poses import TrackingError
from s2c2a.lab.tracking.tags.decoding import DecodingProcess, Image
from s2c2a.lab.tracking.tags.opencv import cv2

MAX_DEVICE = 63
Picture = tuple[np.ndarray, float]
"""Image, 8 bit, (height, width) or (height, width, 3), and its exposure time [s]."""


class PictureSource(Protocol):
    """A camera, a recording or an emulation."""

    def read(self) -> Picture | None:
        """Wait for the next picture; None if the camera is lost."""

    def close(self) -> None:
        """Release the camera; allowed more than once."""


class Webcam:
    """A camera of this computer.

    The exposure time is the time at which the picture arrived, on the clock
    `time.perf_counter`; a webcam does not report its exposures.
    """

    def __init__(self, device: int | str, width: int = 0, height: int = 0):
        """Open the camera.

        Args:
            device: number, or path such as /dev/video0.
            width: of the pictures [pixels]; 0 for the default of the camera.
            height: of the pictures [pixels].

        Raises:
            TrackingError: there is no such camera, or another program uses it.
        """
        self._capture = cv2.VideoCapture(device)
        if not self._capture.isOpened():
            self.close()
            raise TrackingError(
                f"the camera {device} does not open; plug it in, close other programs "
                "that use it, or choose another number"
            )
        # a queue of pictures would only make them old
        self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        if width and height:
            self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
            self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)

    def read(self) -> Picture | None:
        """See `PictureSource`."""
        if not self._capture.grab():
            return None
        now = time.perf_counter()
        is_read, image = self._capture.retrieve()
        return (image, now) if is_read else None

    def close(self) -> None:
        """See `PictureSource`."""
        self._capture.release()


class VideoFile:
    """A recorded video at its own rate; exposure times count from its beginning."""

    def __init__(self, path: str):
        """Open the file.

        Args:
            path: of the video.

        Raises:
            TrackingError: it is no video.
        """
        self._path = path
        self._decoder = DecodingProcess("video", [Path(path)])
        try:
            self._next = self._decode()
        except TrackingError:
            self.close()
            raise
        if self._next is None:
            self.close()
            raise TrackingError(f"{path} is no video that OpenCV reads")
        rate = self._next.rate
        self._period = 1 / rate if 1 <= rate <= 1000 else 1 / 30
        self._start = time.perf_counter()
        self._count = 0

    def read(self) -> Picture | None:
        """See `PictureSource`; None at the end.

        Raises:
            TrackingError: the video is damaged here.
        """
        image = self._next
        if image is None:
            return None
        exposure = self._count * self._period
        self._count += 1
        time.sleep(max(0.0, self._start + exposure - time.perf_counter()))
        self._next = self._decode()
        return image.pixels, exposure

    def close(self) -> None:
        """See `PictureSource`."""
        self._decoder.close()

    def _decode(self) -> Image | None:
        try:
            return self._decoder.read()
        except TrackingError as error:
            raise TrackingError(
                f"{self._path} is no video that OpenCV reads: {error}; record it again, "
                "or convert it"
            ) from error


def open_device(device: str, width: int = 0, height: int = 0) -> PictureSource:
    """Open a camera or a video file.

    Args:
        device: number of a camera, path such as /dev/video0, or a video file.
        width: of a camera's pictures [pixels]; 0 for the default of the camera.
        height: of a camera's pictures [pixels].

    Raises:
        TrackingError: there is no such device or file.
    """
    if device.isascii() and device.isdecimal() and int(device) <= MAX_DEVICE:
        return Webcam(int(device), width, height)
    if device.startswith("/dev/"):
        return Webcam(device, width, height)
    if Path(device).is_file():
        return VideoFile(device)
    raise TrackingError(
        f"no camera {device!r}; give a number (0 to {MAX_DEVICE}), a path such as "
        "/dev/video0, or a video file"
    )


def opener(device: str, width: int, height: int) -> Callable[[], PictureSource]:
    """Return a function that opens a device; a video file opens only once.

    Args:
        device: see `open_device`.
        width: of the pictures [pixels].
        height: of the pictures [pixels].
    """
    played: list[str] = []

    def open_again() -> PictureSource:
        if played:
            raise TrackingError(
                f"the video {device} has ended; make a new tracker to play it again"
            )
        source = open_device(device, width, height)
        if isinstance(source, VideoFile):
            played.append(device)
        return source

    return open_again
