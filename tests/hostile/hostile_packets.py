"""Fuzz test: random and damaged packets at every reader of a pose tracker.

A reader refuses a packet by an error of the package, or takes it. Of a packet that is
cut, or has bytes inserted or removed, it takes either the poses that were sent or none;
of one with other bytes, only poses that are plausible. The same seed damages the same
bytes.
"""

import random
import signal
from collections import Counter
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation import natnet_protocol, qualisys_protocol
from s2c2a.lab.emulation.plant import FramePose as SentPose
from s2c2a.lab.emulation.pose_datagrams import encode_poses
from s2c2a.lab.emulation.tracked_bodies import StreamedBody, to_stream
from s2c2a.lab.tracking import NatNetTracker, QualisysTracker, UdpTracker

SECONDS = 5.0  # for one packet
BAD = ("foreign error", "wrong pose", "hang")
QUARTER = np.sqrt(0.5)
POSES = {
    "base": SentPose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])),
    "end-1": SentPose(
        np.array([0.125, -0.25, 0.5]), np.array([QUARTER, 0.0, 0.0, QUARTER])
    ),
}
NASTY = [
    *b"NaN Infinity -Infinity -1 1e999 1e308 null true {} mm".split(),
    *(b'"', b"\xff", b"9" * 400, b"[" * 999),
]


def streamed(up):
    return {name: StreamedBody(to_stream(pose, up)) for name, pose in POSES.items()}


class HangError(Exception):
    """A reader did not return in time."""


@contextmanager
def limited(seconds):
    def stop(*_):
        raise HangError

    signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


@dataclass(frozen=True)
class Reader:
    """A reader under test.

    Attributes:
        sources: valid packets, to damage.
        read: makes a new tracker read a packet; returns it.
        is_binary: whether inserted and removed bytes break the layout.
    """

    sources: list[bytes]
    read: Callable
    is_binary: bool


def read_json(content):
    tracker = UdpTracker()
    tracker._handle(content, "sender", 0.0)
    return tracker


def read_natnet(version):
    info = natnet_protocol.encode_server_info(version, 1511, "")
    definitions = natnet_protocol.encode_definitions(version, list(POSES))

    def read(content):
        tracker = NatNetTracker()
        tracker._server = "motive"
        # a group that a damaged packet states is not joined
        tracker._join_stated = lambda group: None
        for known in (info, definitions, content):
            tracker._handle(known, "motive", 0.0)
        return tracker

    frame = natnet_protocol.encode_frame(version, 7, 1.5, streamed("y"))
    return Reader([frame, frame, definitions, info], read, True)


def read_qualisys(content):
    from s2c2a.lab.tracking.qualisys.packets import PacketStream

    tracker = QualisysTracker()
    tracker._dialog.connect(0.0)
    for known in (QTM_VERSION, QTM_PARAMETERS, content):
        for packet in PacketStream().feed(known):
            tracker._handle(packet.content, packet.kind, 0.0)
    return tracker


QTM_VERSION = qualisys_protocol.pack_text(1, "Version set to 1.20")
QTM_PARAMETERS = qualisys_protocol.encode_parameters("1.20", list(POSES), "z")
QTM_FRAME = qualisys_protocol.encode_frame(7, 1.5, streamed("z").values())
READERS = {
    "json": Reader([encode_poses(7, 1.5, streamed("z"))], read_json, False),
    **{f"natnet {version}": read_natnet(version) for version in ("3.1", "4.1", "4.2")},
    "qualisys": Reader(
        [QTM_FRAME, QTM_FRAME, QTM_PARAMETERS, QTM_VERSION], read_qualisys, True
    ),
}


def damaged(source, rng):
    """A packet made of another one, and whether its values may have changed."""
    content = bytearray(source)
    place = rng.randrange(len(content))
    match rng.randrange(7):
        case 0:
            return rng.randbytes(rng.randrange(600)), True
        case 1:
            return bytes(content[:place]), False
        case 2:
            content[place:place] = rng.randbytes(rng.randrange(1, 9))
            return bytes(content), False
        case 3:
            del content[place : place + rng.randrange(1, 9)]
            return bytes(content), False
        case 4:
            content[place : place + 4] = rng.randbytes(4)
        case 5:
            for _ in range(rng.randrange(1, 6)):
                content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
        case 6:
            nasty = rng.choice(NASTY)
            content[place : place + len(nasty)] = nasty
    return bytes(content), True


def judge(tracker, may_differ):
    """What became of a packet that was taken."""
    frame = tracker.latest()
    if frame is None:
        return "no frame"
    if all(is_sent(name, pose) for name, pose in frame.poses.items()):
        return "unchanged"
    plausible = all(map(is_plausible, frame.poses.values()))
    return "plausible" if plausible and may_differ else "wrong pose"


def is_sent(name, pose):
    if name not in POSES:
        return False
    sent = POSES[name]
    is_there = np.allclose(pose.position, sent.position, atol=1e-6)
    # bytes that replace the end of the last packet of a stream change a number by less
    # than a rotation matrix may be wrong
    return is_there and np.allclose(pose.rotation, sent.rotation, atol=1e-3)


def is_plausible(pose):
    is_unit = abs(np.linalg.norm(pose.rotation) - 1) < 1e-9
    return bool(is_unit and np.abs(pose.position).max() <= 100)


def outcome(reader, content, may_differ):
    try:
        with limited(SECONDS):
            return judge(reader.read(content), may_differ)
    except S2C2AError:
        return "our error"
    except HangError:
        return "hang"
    except Exception:
        return "foreign error"


def read_all(name, count, seed=0):
    """Outcomes of many packets, and the bad packets."""
    reader = READERS[name]
    rng = random.Random(f"{name} {seed}")
    counts = Counter()
    bad = []
    for _ in range(count):
        content, differs = damaged(rng.choice(reader.sources), rng)
        ending = outcome(reader, content, differs or not reader.is_binary)
        counts[ending] += 1
        if ending in BAD:
            bad.append((ending, content))
    return counts, bad
