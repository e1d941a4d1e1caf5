"""Emulated motion capture in a thread, with fixed poses, and waiting for what it sends."""

import socket
import threading
import time
from contextlib import contextmanager

import numpy as np

from s2c2a.lab.emulation.motive import Motive, MotiveOptions
from s2c2a.lab.emulation.plant import FramePose
from s2c2a.lab.emulation.qtm import Qtm, QtmOptions
from waiting import until as wait_until

PATIENCE = 300.0  # s, on a busy machine
QUARTER = np.sqrt(0.5)
POSES = {
    "base": FramePose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])),
    "end-1": FramePose(
        np.array([0.125, -0.25, 0.5]), np.array([QUARTER, 0.0, 0.0, QUARTER])
    ),
}


def free_port(kind=socket.SOCK_DGRAM):
    with socket.socket(socket.AF_INET, kind) as opened:
        opened.bind(("127.0.0.1", 0))
        return opened.getsockname()[1]


def frames_arrive(tracker, count=5):
    before = tracker.counts.accepted
    wait_until(lambda: tracker.counts.accepted >= before + count)


@contextmanager
def served(server, poses):
    """A server that is open and sends poses."""
    stop = threading.Event()

    def serve():
        start = time.monotonic()
        while not stop.wait(0.002):
            server.serve(time.monotonic() - start, lambda: poses)

    server.open()
    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        server.close()


@contextmanager
def motive_streaming(**options):
    """A stream of NatNet on free ports; yields keywords of its tracker."""
    ports = {"command_port": free_port(), "data_port": free_port()}
    with served(Motive(list(POSES), MotiveOptions(**ports, **options)), POSES):
        yield ports


@contextmanager
def qtm_streaming(poses=POSES, **options):
    """A stream of QTM on a free port; yields the port and the server."""
    port = free_port(socket.SOCK_STREAM)
    qtm = Qtm(list(poses), QtmOptions(port=port, **options))
    with served(qtm, poses):
        yield port, qtm
