"""Keys of the terminal that stop a real arm."""

import os
import threading
import time
from types import SimpleNamespace

import pytest

from s2c2a.cli import emergency
from s2c2a.runtime.emergency import EMERGENCY_STOP

pty = pytest.importorskip("pty")
termios = pytest.importorskip("termios")
REAL_ARM = SimpleNamespace(simulated=False)


@pytest.fixture
def keyboard(monkeypatch):
    """Write end of a terminal that is the standard input."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs) as stdin, os.fdopen(ours, "wb", buffering=0) as keys:
        monkeypatch.setattr("sys.stdin", stdin)
        yield keys


def is_stopped_within(seconds):
    end = time.monotonic() + seconds
    while not EMERGENCY_STOP.is_triggered and time.monotonic() < end:
        time.sleep(0.01)
    return EMERGENCY_STOP.is_triggered


@pytest.mark.parametrize("key", [b" ", b"\x1b"])
def test_a_key_stops_a_real_arm(keyboard, key):
    with emergency.emergency_controls(REAL_ARM):
        keyboard.write(key)
        assert is_stopped_within(5.0)


def test_other_keys_do_not_stop_the_arm(keyboard):
    with emergency.emergency_controls(REAL_ARM):
        keyboard.write(b"x")
        assert not is_stopped_within(0.1)


def test_the_terminal_is_restored(keyboard):
    before = termios.tcgetattr(keyboard.fileno())
    with emergency.emergency_controls(REAL_ARM):
        assert termios.tcgetattr(keyboard.fileno()) != before
    assert termios.tcgetattr(keyboard.fileno()) == before


def test_a_process_in_the_background_leaves_the_terminal_alone(keyboard, monkeypatch):
    monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp() + 1)
    before = termios.tcgetattr(keyboard.fileno())
    with emergency.emergency_controls(REAL_ARM):
        assert termios.tcgetattr(keyboard.fileno()) == before


def test_a_closed_terminal_ends_the_watch():
    read_end, write_end = os.pipe()
    os.close(write_end)
    watcher = threading.Thread(
        target=emergency._watch_keys, args=(read_end, threading.Event()), daemon=True
    )
    watcher.start()
    watcher.join(5.0)
    os.close(read_end)
    assert not watcher.is_alive()
    assert not EMERGENCY_STOP.is_triggered
