"""Viewers that receive everything and draw nothing: `python watching.py PORT COUNT`."""

import sys
import threading

import msgspec
import viser
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

_CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (1.0, 1.0, 1.0),
    "fov": 0.7,
    "near": 0.01,
    "far": 100.0,
    "image_height": 800,
    "image_width": 1280,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}


def watch(port: int) -> None:
    """Say where from, then listen until the page closes."""
    with connect(
        f"ws://127.0.0.1:{port}",
        origin=Origin(f"http://127.0.0.1:{port}"),
        subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
        max_size=None,
    ) as page:
        page.send(msgspec.msgpack.encode(_CAMERA))
        for _ in page:
            pass


if __name__ == "__main__":
    watchers = [
        threading.Thread(target=watch, args=(int(sys.argv[1]),))
        for _ in range(int(sys.argv[2]))
    ]
    for watcher in watchers:
        watcher.start()
    for watcher in watchers:
        watcher.join()
