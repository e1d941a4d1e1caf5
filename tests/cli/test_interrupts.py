"""Handling of Ctrl-C at any time."""

import sys
import time

import pytest

from s2c2a.cli.interrupts import interrupts_as_exceptions


class Interrupted:
    """Interrupted in its finalizer, where Python cannot raise an exception."""

    def __del__(self):
        raise KeyboardInterrupt


class Faulty:
    """Fails in its finalizer."""

    def __del__(self):
        raise ValueError("while clearing up")


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_that_python_swallows_is_repeated():
    def work():
        with interrupts_as_exceptions():
            Interrupted()
            time.sleep(5.0)

    with pytest.raises(KeyboardInterrupt):
        work()


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_during_an_import_is_raised_after_it(tmp_path, monkeypatch):
    (tmp_path / "takes_its_time.py").write_text(
        "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\n"
        "time.sleep(0.05)\nwhole = True\n"
    )
    monkeypatch.syspath_prepend(tmp_path)

    def work():
        with interrupts_as_exceptions():
            import takes_its_time  # noqa: F401, PLC0415

            time.sleep(5.0)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert sys.modules.pop("takes_its_time").whole


def test_other_exceptions_pass_unchanged():
    def work():
        with interrupts_as_exceptions():
            raise ImportError("no such module")

    with pytest.raises(ImportError, match="no such module"):
        work()


def test_other_unraisable_errors_reach_the_previous_hook(monkeypatch):
    errors = []
    monkeypatch.setattr(
        sys, "unraisablehook", lambda error: errors.append(error.exc_type)
    )
    before = sys.unraisablehook
    with interrupts_as_exceptions():
        Faulty()
    assert errors == [ValueError]
    assert sys.unraisablehook is before
