"""The tracker receives the frames of an emulated QTM."""

import socket
import struct
import time
from contextlib import contextmanager

import numpy as np
import pytest
from streams import POSES, frames_arrive, free_port, qtm_streaming, wait_until

from s2c2a.lab.emulation import qualisys_protocol
from s2c2a.lab.tracking import DropReason, QualisysTracker, TrackingError


@contextmanager
def tracking(**options):
    """A tracker of an emulated QTM."""
    with qtm_streaming(**options) as (port, _), QualisysTracker(port=port) as tracker:
        yield tracker


@pytest.mark.parametrize("up", ["y", "z"])
def test_poses_arrive_by_name_with_z_up(up):
    with tracking(up=up) as tracker:
        frames_arrive(tracker)
        frame = tracker.latest()
        assert tracker.bodies == ["base", "end-1"]
        assert tracker.problem == ""
    assert 0 <= time.perf_counter() - frame.arrival_time < 20
    for name, pose in POSES.items():
        np.testing.assert_allclose(frame.poses[name].position, pose.position)
        rotation = frame.poses[name].rotation
        np.testing.assert_allclose(rotation, pose.rotation, atol=1e-6)


def test_a_hidden_body_is_absent():
    with tracking(faults=("0 hidden end-1",)) as tracker:
        frames_arrive(tracker)
        assert sorted(tracker.latest().poses) == ["base"]


def test_the_tracker_connects_again_after_a_restart(monkeypatch):
    monkeypatch.setattr("s2c2a.lab.tracking.datagrams.RESTART_SILENCE", 0.2)
    # late enough that the clock steps back by more than the silence
    with tracking(faults=("0.5 restart 0.3",)) as tracker:
        frames_arrive(tracker)
        wait_until(lambda: "does not answer" in tracker.problem)
        wait_until(lambda: tracker.counts.restarts == 1)
        frames_arrive(tracker)
        assert tracker.problem == ""


def test_faults_of_the_stream_are_counted_by_reason():
    faults = ("0 duplicated 0.2", "0 reordered 0.2", "0 incomplete 0.2", "0 absurd 0.2")
    with tracking(faults=faults) as tracker:
        reasons = ("DUPLICATE", "LATE", "MALFORMED", "IMPLAUSIBLE")
        for one in reasons:
            wait_until(lambda one=one: tracker.counts.dropped[DropReason[one]])
        frames_arrive(tracker)
        assert tracker.counts.dropped[DropReason.FAILED] == 0


def test_a_stream_whose_frame_number_stays_1_is_a_stream(monkeypatch):
    encode = qualisys_protocol.encode_frame
    monkeypatch.setattr(
        qualisys_protocol, "encode_frame", lambda number, *rest: encode(1, *rest)
    )
    with tracking() as tracker:
        frames_arrive(tracker, 10)
        assert not any(tracker.counts.dropped.values())
        assert tracker.counts.restarts == 0


def test_random_bytes_in_the_stream_end_in_a_new_connection():
    with tracking(faults=("0.1 garbage 1", "0.3 garbage 0")) as tracker:
        wait_until(lambda: tracker.counts.dropped[DropReason.MALFORMED] > 0)
        frames_arrive(tracker, 20)
        assert tracker.counts.dropped[DropReason.FAILED] == 0


def test_a_missing_version_is_refused_at_the_start():
    with (
        qtm_streaming(version="1.8") as (port, _),
        pytest.raises(TrackingError, match=r"does not have version 1\.20"),
    ):
        QualisysTracker(port=port).start()


def test_an_absent_qtm_is_reported_with_its_address():
    port = free_port(socket.SOCK_STREAM)
    with pytest.raises(TrackingError, match=f"{port} does not answer"):
        QualisysTracker(port=port, timeout=0.2).start()


def test_a_program_that_accepts_and_stays_silent_is_no_qtm():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        port = listener.getsockname()[1]
        with pytest.raises(TrackingError, match="does not answer"):
            QualisysTracker(port=port, timeout=0.3).start()


def test_without_bodies_the_start_fails():
    with (
        qtm_streaming(poses={}) as (port, _),
        pytest.raises(TrackingError, match="Parameters not available"),
    ):
        QualisysTracker(port=port, timeout=0.3).start()


def test_without_a_measurement_the_tracker_waits_and_says_so():
    with tracking(is_measuring=False) as tracker:
        wait_until(lambda: "start a measurement" in tracker.problem)
        assert tracker.bodies == ["base", "end-1"]
        assert tracker.latest() is None


def test_bodies_in_another_order_get_their_new_names():
    with qtm_streaming() as (port, qtm), QualisysTracker(port=port) as tracker:
        frames_arrive(tracker)
        event = struct.pack("<IIB", 9, 6, 3)
        qtm._names.reverse()
        qtm._encode = lambda number, time, bodies: (
            event + type(qtm)._encode(qtm, number, time, dict(reversed(bodies.items())))
        )
        wait_until(lambda: tracker.counts.dropped[DropReason.EARLY] > 0)
        position = tracker.latest().poses["base"].position
        np.testing.assert_allclose(position, POSES["base"].position)


@pytest.mark.parametrize("port", [0, 65_536])
def test_an_impossible_port_is_refused(port):
    with pytest.raises(TrackingError, match="choose 1 to 65535"):
        QualisysTracker(port=port)
