"""An emulated QTM in a thread, with fixed poses."""

import socket
import threading
import time
from contextlib import contextmanager

import numpy as np

from s2c2a.lab.emulation.plant import FramePose
from s2c2a.lab.emulation.qtm import Qtm, QtmOptions

PATIENCE = 300.0  # s, on a busy machine
QUARTER = np.sqrt(0.5)
POSES = {
    "base": FramePose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])),
    "end-1": FramePose(
        np.array([0.125, -0.25, 0.5]), np.array([QUARTER, 0.0, 0.0, QUARTER])
    ),
}


def free_tcp_port():
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as opened:
        opened.bind(("127.0.0.1", 0))
        return opened.getsockname()[1]


def wait_until(condition):
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.002)


def _serve(qtm, stop, poses):
    start = time.monotonic()
    while not stop.wait(0.002):
        qtm.serve(time.monotonic() - start, lambda: poses)


@contextmanager
def qtm_streaming(poses=POSES, **options):
    """A stream on a free port; yields the port and the server."""
    port = free_tcp_port()
    qtm = Qtm(list(poses), QtmOptions(port=port, **options))
    qtm.open()
    stop = threading.Event()
    thread = threading.Thread(target=_serve, args=(qtm, stop, poses))
    thread.start()
    try:
        yield port, qtm
    finally:
        stop.set()
        thread.join()
        qtm.close()
