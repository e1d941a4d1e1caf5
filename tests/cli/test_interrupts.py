"""Ctrl-C is heeded whenever it comes."""

import sys
import time

import pytest

from s2c2a.cli.interrupts import interrupts_heeded


class Interrupted:
    """Is interrupted when it goes, where Python can raise nothing."""

    def __del__(self):
        raise KeyboardInterrupt


class Faulty:
    """Fails when it goes."""

    def __del__(self):
        raise ValueError("while clearing up")


def test_an_interrupt_that_python_swallows_comes_once_more():
    def work():
        with interrupts_heeded():
            Interrupted()
            time.sleep(5.0)

    with pytest.raises(KeyboardInterrupt):
        work()


def test_other_faults_go_to_whom_they_went_before(monkeypatch):
    heard = []
    monkeypatch.setattr(sys, "unraisablehook", lambda lost: heard.append(lost.exc_type))
    before = sys.unraisablehook
    with interrupts_heeded():
        Faulty()
    assert heard == [ValueError]
    assert sys.unraisablehook is before
