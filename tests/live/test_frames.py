"""Frames are drawn on time, and missed frames are skipped."""

import threading

import pytest

from s2c2a.live import window
from s2c2a.live.window import frames


class FakeTime:
    """A clock that advances by waiting, or by assignment."""

    def __init__(self):
        self.now = 100.0
        self.waits = []

    def wait(self, seconds):
        self.waits.append(seconds)
        self.now += seconds
        return False


@pytest.fixture
def time(monkeypatch):
    """A fake clock in place of the real one."""
    clock = FakeTime()
    monkeypatch.setattr(window.time, "perf_counter", lambda: clock.now)
    return clock


def test_the_time_of_drawing_does_not_delay_the_next_frame(time):
    steady = frames(0.1, time)
    elapsed = [next(steady)]
    for _ in range(3):
        time.now += 0.03
        elapsed.append(next(steady))
    assert elapsed == pytest.approx([0.0, 0.1, 0.1, 0.1])
    assert time.waits == pytest.approx([0.0, 0.07, 0.07, 0.07])


def test_missed_frames_are_skipped_and_other_threads_run(time):
    steady = frames(0.1, time)
    next(steady)
    time.now += 0.23
    assert next(steady) == pytest.approx(0.3)
    assert time.waits[-1] == pytest.approx(0.07)


def test_a_closed_window_has_no_frames():
    closing = threading.Event()
    closing.set()
    assert list(frames(10.0, closing)) == []
