"""Pictures and videos from files, decoded in a process of their own (`decoder`)."""

import subprocess
from collections.abc import Sequence
from pathlib import Path
from threading import Timer
from typing import IO, NamedTuple

import numpy as np

from s2c2a.execution.child import child_command
from s2c2a.lab.tracking.poses import TrackingError
from s2c2a.lab.tracking.tags import decoder
from s2c2a.lab.tracking.tags.camera import MAX_SIDE

PATIENCE = 30.0  # s; for one image


class Image(NamedTuple):
    """A decoded image.

    Attributes:
        pixels: 8 bit, shape (height, width) or (height, width, 3).
        rate: images a second of the video; 0 if unknown.
    """

    pixels: np.ndarray
    rate: float


class DecodingProcess:
    """A process that decodes files; whatever happens to it is an error here."""

    def __init__(self, kind: str, paths: Sequence[Path]):
        """Start the process.

        Args:
            kind: "video" or "pictures".
            paths: of one video, or of pictures.
        """
        files = [str(path.absolute()) for path in paths]
        self._process = subprocess.Popen(
            child_command(decoder.__file__, kind, *files),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            stdin=subprocess.DEVNULL,
        )

    def read(self) -> Image | None:
        """Wait for the next image; None at the end.

        Raises:
            TrackingError: the process ended early, takes too long, or the image is too
                large: the file is damaged.
        """
        timer = Timer(PATIENCE, self._process.kill)
        timer.start()
        try:
            return self._read()
        finally:
            timer.cancel()

    def close(self) -> None:
        """End the process; allowed more than once."""
        self._process.kill()
        self._output.close()
        self._process.wait()

    @property
    def _output(self) -> IO[bytes]:
        assert self._process.stdout is not None
        return self._process.stdout

    def _read(self) -> Image | None:
        header = self._read_bytes(decoder.HEADER.size)
        if header == decoder.END:
            return None
        rate, height, width, colors = decoder.HEADER.unpack(header)
        if not (0 < height <= MAX_SIDE and 0 < width <= MAX_SIDE and colors in (1, 3)):
            raise TrackingError(
                f"an image of {width} x {height} pixels; at most {MAX_SIDE} x {MAX_SIDE} "
                "are allowed"
            )
        content = self._read_bytes(height * width * colors)
        shape = (height, width) if colors == 1 else (height, width, colors)
        return Image(np.frombuffer(bytearray(content), np.uint8).reshape(shape), rate)

    def _read_bytes(self, count: int) -> bytes:
        content = self._output.read(count)
        if len(content) < count:
            raise TrackingError("OpenCV cannot decode it")
        return content
