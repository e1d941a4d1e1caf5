"""Program that decodes pictures or a video with OpenCV, and writes them to its output.

`decoding` runs it: a damaged file may end a process that decodes it in native code, or
fill the memory. Each image is a header (`HEADER`) and its bytes; one of height 0 is the end.
"""

import os
import struct
import sys

from s2c2a.execution.child import limit_memory
from s2c2a.files.text import open_regular

MAX_MEMORY = 6_000_000_000  # bytes; OpenCV with its threads reserves 2
HEADER = struct.Struct("<dIII")
"""Pictures a second (0 if unknown), height, width, number of colors."""
END = HEADER.pack(0.0, 0, 0, 0)


def main(kind: str, *paths: str) -> None:
    """Write the images of a video, or one image for each picture."""
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no image
    limit_memory(MAX_MEMORY)
    if kind == "video":
        _write_video(output, paths[0])
    else:
        import cv2
        import numpy as np

        for path in paths:
            with open_regular(path) as file:
                content = np.frombuffer(file.read(), np.uint8)
            _write_image(output, cv2.imdecode(content, cv2.IMREAD_GRAYSCALE), 0.0)
    output.write(END)
    output.close()


def _write_video(output, path: str) -> None:
    # a list of videos must not lead to other files or to the network
    os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = "protocol_whitelist;file"
    import cv2

    capture = cv2.VideoCapture(path)
    rate = capture.get(cv2.CAP_PROP_FPS)
    while True:
        is_read, image = capture.read()
        if not is_read:
            return
        _write_image(output, image, rate)


def _write_image(output, image, rate: float) -> None:
    height, width, *colors = image.shape
    output.write(HEADER.pack(rate, height, width, *(colors or [1])))
    output.write(image.tobytes())
    output.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
