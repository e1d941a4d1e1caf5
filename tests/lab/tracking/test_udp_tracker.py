"""The tracker receives datagrams and survives bad ones."""

import itertools
import json
import random
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from streams import wait_until

from s2c2a.lab.tracking import DropReason, ModuleEnds, TrackingError, UdpTracker

EXAMPLE = Path(__file__).parents[3] / "examples" / "extending" / "send_poses.py"
BODY = {"position": [0.0, 0.0, 0.2], "rotation": [0.0, 0.0, 0.0, 1.0]}


@pytest.fixture
def tracker():
    with UdpTracker(port=0) as started:
        yield started


@pytest.fixture
def sender():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        yield opened


def datagram(frame):
    content = {"time": 0.1 * frame, "frame": frame, "bodies": {"end-1": BODY}}
    return json.dumps(content).encode()


def test_the_newest_frame_is_kept_with_its_arrival_time(tracker, sender):
    sent_at = time.perf_counter()
    for frame in (1, 2):
        sender.sendto(datagram(frame), tracker.address)
    wait_until(lambda: tracker.counts.accepted == 2)
    latest = tracker.latest()
    assert (latest.number, latest.source_time) == (2, 0.2)
    assert sent_at <= latest.arrival_time <= time.perf_counter()
    assert tracker.latest() is latest


def test_bad_datagrams_are_counted_and_the_next_good_one_arrives(tracker, sender):
    for content in (datagram(1), datagram(1), datagram(0), b"", b"x" * 20_000):
        sender.sendto(content, tracker.address)
    for reason in ("DUPLICATE", "LATE", "MALFORMED", "OVERSIZED"):
        wait_until(lambda one=reason: tracker.counts.dropped[DropReason[one]] == 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.sendto(datagram(2), tracker.address)
        wait_until(lambda: tracker.counts.dropped[DropReason.OTHER_SENDER] == 1)
    sender.sendto(datagram(2), tracker.address)
    wait_until(lambda: tracker.counts.accepted == 2)


def test_a_flood_of_random_bytes_leaves_the_receiver_alive(tracker, sender):
    rng = random.Random(0)
    for _ in range(500):
        sender.sendto(rng.randbytes(rng.randint(0, 100)), tracker.address)
    frames = itertools.count(1)

    def arrived():
        sender.sendto(datagram(next(frames)), tracker.address)
        return tracker.counts.accepted > 0

    wait_until(arrived)


def test_a_taken_port_is_reported_with_its_number(tracker):
    host, port = tracker.address
    with pytest.raises(TrackingError, match=str(port)):
        UdpTracker(host, port).start()


@pytest.mark.parametrize("host", ["256.1.1.1", "\ud800", "a" * 300, "a\0b"])
def test_an_impossible_host_is_reported(host):
    with pytest.raises(TrackingError, match="cannot listen"):
        UdpTracker(host, 0).start()


@pytest.mark.parametrize("port", [-1, 65_536, 10**30])
def test_an_impossible_port_is_reported(port):
    with pytest.raises(TrackingError, match="choose 0 to 65535"):
        UdpTracker(port=port)


def test_closing_twice_and_starting_again_works():
    tracker = UdpTracker(port=0)
    tracker.close()
    tracker.start()
    tracker.start()
    tracker.close()
    tracker.close()
    with pytest.raises(TrackingError, match="start"):
        _ = tracker.address
    with tracker:
        assert tracker.address[0] == "127.0.0.1"
    assert "UdpTracker" not in [one.name for one in threading.enumerate()]


def test_the_example_sender_moves_a_module_end(tracker):
    port = str(tracker.address[1])
    subprocess.run([sys.executable, EXAMPLE, port, "3"], check=True)
    wait_until(lambda: tracker.counts.accepted == 3)
    (state,) = ModuleEnds.of(1, base=None).states(tracker.latest())
    assert state.tolist() == pytest.approx([0.002, 0, 0.2, 0, 0, 1])


def test_a_tracker_says_why_it_has_no_frames(tracker, sender):
    assert "nothing arrives on 127.0.0.1" in tracker.problem
    sender.sendto(b'{"unit": "mm"}', tracker.address)
    wait_until(lambda: "1 MALFORMED" in tracker.problem)
