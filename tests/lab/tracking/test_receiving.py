"""The thread that trackers share: it outlives failures, and pauses when a source is lost."""

import threading
from enum import Enum

import pytest
from streams import PATIENCE

from s2c2a.lab.tracking import PoseFrame, TrackingError, receiving
from s2c2a.lab.tracking.receiving import ReceivingTracker
from s2c2a.lab.tracking.tracker import DropError

LOST = TrackingError("the source is lost")


class Reason(Enum):
    STRANGE = "strange"
    FAILED = "failed"


class Scripted(ReceivingTracker):
    """Receives a list of connections, each a list of packets; the last one stays."""

    drop_reasons = Reason

    def __init__(self, *connections, at_start=None):
        self._connections = list(connections)
        self._at_start = at_start
        self.released = 0
        super().__init__()

    def _open(self):
        if self._at_start is not None:
            raise self._at_start

    def _release(self):
        self.released += 1

    def _packets(self, stop):
        if not self._connections:
            stop.wait()
        for packet in self._connections.pop(0) if self._connections else []:
            if isinstance(packet, Exception):
                raise packet
            yield packet, "sender", 0.0

    def _handle(self, content, source, arrival):
        if content == "strange":
            raise DropError("a strange packet", Reason.STRANGE)
        self._keep(PoseFrame(arrival, 0.0, 1 // content, {}))


class PauseEvent(threading.Event):
    """Notes pauses instead of waiting; the event is set after some."""

    def __init__(self, count):
        super().__init__()
        self._count = count
        self.pauses = []

    def wait(self, timeout=None):
        self.pauses.append(timeout)
        if len(self.pauses) == self._count:
            self.set()
        return self.is_set()


def test_pauses_double_while_the_source_is_lost_and_begin_again_after_a_frame():
    tracker = Scripted(*[[LOST]] * 7, [1, LOST], [LOST], [LOST])
    stop = PauseEvent(10)
    tracker._run(stop)
    lost = [0.1, 0.2, 0.4, 0.8, 1.6, 3.0, 3.0]
    assert stop.pauses == pytest.approx([*lost, 0.1, 0.2, 0.4])
    assert tracker.counts.accepted == 1


def test_packets_after_a_bad_one_are_used_and_failures_counted_but_no_lost_source():
    tracker = Scripted(["strange", 0, 1, 0, 1], [ZeroDivisionError()], [LOST])
    tracker._run(PauseEvent(3))
    assert tracker.counts.accepted == 2
    assert tracker.counts.dropped == {Reason.STRANGE: 1, Reason.FAILED: 3}


def test_a_start_that_fails_releases_what_was_opened_and_may_be_repeated():
    tracker = Scripted([1], at_start=LOST)
    for attempt in (1, 2):
        with pytest.raises(TrackingError, match="is lost"):
            tracker.start()
        assert tracker.released == attempt


def test_a_driver_that_hangs_is_left_behind_and_changes_nothing_later(monkeypatch):
    monkeypatch.setattr(receiving, "CLOSE_TIME", 0.01)
    answers = threading.Event()

    class Hanging(Scripted):
        def _packets(self, stop):
            answers.wait(PATIENCE)
            yield 1, "sender", 0.0

    tracker = Hanging()
    tracker.start()
    hung = tracker._thread
    tracker.close()
    assert hung.is_alive()
    tracker._reset()
    answers.set()
    hung.join(PATIENCE)
    assert not hung.is_alive()
    assert tracker.latest() is None
    assert tracker.counts.accepted == 0
