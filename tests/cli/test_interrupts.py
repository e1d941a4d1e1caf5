"""Ctrl-C is heeded whenever it comes."""

import signal
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


@pytest.fixture
def attentive():
    """A process that takes interrupts: what a shell starts in the background ignores them."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("attentive")
def test_an_interrupt_that_python_swallows_comes_once_more():
    def work():
        with interrupts_heeded():
            Interrupted()
            time.sleep(5.0)

    with pytest.raises(KeyboardInterrupt):
        work()


@pytest.mark.usefixtures("attentive")
def test_an_interrupt_waits_for_the_end_of_an_import(tmp_path, monkeypatch):
    (tmp_path / "takes_its_time.py").write_text(
        "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(0.05)\nwhole = True\n"
    )
    monkeypatch.syspath_prepend(tmp_path)

    def work():
        with interrupts_heeded():
            import takes_its_time

            time.sleep(5.0)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert sys.modules.pop("takes_its_time").whole


def test_a_fault_without_an_interrupt_stays_one():
    def work():
        with interrupts_heeded():
            raise ImportError("no such module")

    with pytest.raises(ImportError, match="no such module"):
        work()


def test_other_faults_go_to_whom_they_went_before(monkeypatch):
    heard = []
    monkeypatch.setattr(sys, "unraisablehook", lambda lost: heard.append(lost.exc_type))
    before = sys.unraisablehook
    with interrupts_heeded():
        Faulty()
    assert heard == [ValueError]
    assert sys.unraisablehook is before
