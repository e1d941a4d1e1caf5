"""Things are shown on time, and what is late makes room."""

import threading

import pytest

from s2c2a.live import window
from s2c2a.live.window import frames


class Time:
    """Passes when it is waited for, or when a test says so."""

    def __init__(self):
        self.now, self.waited = 100.0, []

    def wait(self, seconds):
        self.waited.append(seconds)
        self.now += seconds
        return False


@pytest.fixture
def time(monkeypatch):
    """Takes the place of the clock."""
    passing = Time()
    monkeypatch.setattr(window.time, "perf_counter", lambda: passing.now)
    return passing


def test_the_time_that_drawing_takes_is_not_added(time):
    steady = frames(0.1, time)
    passed = [next(steady)]
    for _ in range(3):
        time.now += 0.03
        passed.append(next(steady))
    assert passed == pytest.approx([0.0, 0.1, 0.1, 0.1])
    assert time.waited == pytest.approx([0.0, 0.07, 0.07, 0.07])


def test_what_is_late_is_left_out_and_others_get_their_turn(time):
    steady = frames(0.1, time)
    next(steady)
    time.now += 0.23
    assert next(steady) == pytest.approx(0.3)
    assert time.waited[-1] == pytest.approx(0.07)


def test_it_ends_at_once():
    over = threading.Event()
    over.set()
    assert list(frames(10.0, over)) == []
