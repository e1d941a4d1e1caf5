"""The tracker and an emulated Motive, over loopback."""

import time
from contextlib import contextmanager

import numpy as np
import pytest
from streams import POSES, frames_arrive, free_port, motive_streaming, wait_until

from s2c2a.lab.tracking import DropReason, NatNetTracker, TrackingError
from s2c2a.lab.tracking.natnet.layouts import LAYOUTS

GROUP = "239.255.42.99"


@contextmanager
def tracking(up="y", **options):
    """A tracker of an emulated Motive."""
    with (
        motive_streaming(up=up, **options) as ports,
        NatNetTracker(**ports, up=up) as tracker,
    ):
        yield tracker


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("version", ["3.1", "4.0", "4.1", "4.2"])
def test_poses_arrive_as_they_are(version, up):
    with tracking(up, version=version) as tracker:
        frames_arrive(tracker)
        frame = tracker.latest()
        age = time.perf_counter() - frame.arrival_time
        counts = tracker.counts
        problem = tracker.problem
    assert sorted(frame.poses) == sorted(POSES)
    for name, pose in POSES.items():
        np.testing.assert_allclose(frame.poses[name].position, pose.position)
        received = frame.poses[name].rotation
        np.testing.assert_allclose(received, pose.rotation, atol=1e-6)
    assert 0 <= age < 20
    assert counts.dropped[DropReason.MALFORMED] == 0
    assert problem == ""


@pytest.mark.parametrize("stated", [GROUP, None])
def test_multicast_frames_arrive_with_the_group_given_or_stated(stated):
    with (
        motive_streaming(multicast=GROUP) as ports,
        NatNetTracker(**ports, multicast=stated) as tracker,
    ):
        frames_arrive(tracker)
        assert tracker.bodies == ["base", "end-1"]


def test_the_tracker_connects_again_after_a_restart():
    with tracking(faults=("1 restart 1.5",)) as tracker:
        frames_arrive(tracker)
        wait_until(lambda: "does not answer" in tracker.problem)
        wait_until(lambda: tracker.counts.restarts == 1)
        frames_arrive(tracker)
        assert tracker.problem == ""
        assert tracker.latest().number < 1000


def test_faults_of_the_network_are_counted_by_reason():
    faults = ("0 reordered 0.2", "0 duplicated 0.2", "0 garbage 0.3", "0 lost 0.1")
    with tracking(faults=faults) as tracker:
        frames_arrive(tracker, 60)
        wait_until(lambda: tracker.counts.dropped[DropReason.LATE] > 0)
        dropped = tracker.counts.dropped
    assert dropped[DropReason.DUPLICATE] + dropped[DropReason.LATE] > 2
    assert dropped[DropReason.MALFORMED] > 2
    assert dropped[DropReason.FAILED] == 0


def test_an_unsupported_version_is_refused_at_the_start(monkeypatch):
    known = {version: LAYOUTS[version] for version in LAYOUTS if version < (4, 2)}
    monkeypatch.setattr("s2c2a.lab.tracking.natnet.connection.LAYOUTS", known)
    with motive_streaming(version="4.2") as ports:
        tracker = NatNetTracker(**ports)
        with pytest.raises(TrackingError, match=r"NatNet 4\.2, and s2c2a reads 3\.1"):
            tracker.start()


def test_an_absent_motive_is_reported_with_its_address():
    port = free_port()
    with pytest.raises(TrackingError, match=f"{port} does not answer"):
        NatNetTracker(command_port=port, timeout=0.2).start()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"command_port": 0}, "choose 1 to 65535"),
        ({"data_port": 65_536}, "choose 1 to 65535"),
        ({"host": "256.1.1.1"}, "no host"),
        ({"host": "a\0b"}, "no host"),
        ({"local": "192.0.2.1"}, "cannot listen"),
        ({"multicast": "10.0.0.1"}, "cannot listen to the group"),
    ],
)
def test_impossible_addresses_are_reported(options, words):
    with pytest.raises(TrackingError, match=words):
        NatNetTracker(**options, timeout=0.1).start()
