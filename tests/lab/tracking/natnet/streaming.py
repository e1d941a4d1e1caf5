"""An emulated Motive in a thread, with fixed poses."""

import socket
import threading
import time
from contextlib import contextmanager

import numpy as np

from s2c2a.lab.emulation.motive import Motive, MotiveOptions
from s2c2a.lab.emulation.plant import FramePose

PATIENCE = 300.0  # s, on a busy machine
QUARTER = np.sqrt(0.5)
POSES = {
    "base": FramePose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])),
    "end-1": FramePose(
        np.array([0.125, -0.25, 0.5]), np.array([QUARTER, 0.0, 0.0, QUARTER])
    ),
}


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind(("127.0.0.1", 0))
        return opened.getsockname()[1]


def wait_until(condition):
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.002)


def _serve(motive, stop):
    start = time.monotonic()
    while not stop.wait(0.002):
        motive.serve(time.monotonic() - start, lambda: POSES)


@contextmanager
def streaming(**options):
    """A stream on free ports; yields keywords of its tracker."""
    ports = {"command_port": free_port(), "data_port": free_port()}
    motive = Motive(list(POSES), MotiveOptions(**ports, **options))
    motive.open()
    stop = threading.Event()
    thread = threading.Thread(target=_serve, args=(motive, stop))
    thread.start()
    try:
        yield ports
    finally:
        stop.set()
        thread.join()
        motive.close()
