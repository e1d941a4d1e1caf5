"""SIGUSR1 stops the arm of the live page, from its opening until it is at rest."""

import multiprocessing
import os
import signal
import sys
from unittest.mock import Mock

import pytest

from s2c2a.live import process
from s2c2a.live.cli import live as command
from s2c2a.live.request import RequestLimits
from s2c2a.runtime import EMERGENCY_STOP

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="needs SIGUSR1")


@pytest.fixture(autouse=True)
def restored():
    """Signal handlers and switch interval as they were."""
    names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1")
    before = {name: signal.getsignal(getattr(signal, name)) for name in names}
    interval = sys.getswitchinterval()
    yield
    for name, handler in before.items():
        signal.signal(getattr(signal, name), handler)
    sys.setswitchinterval(interval)


def signal_this_process():
    os.kill(os.getpid(), signal.SIGUSR1)


@pytest.mark.parametrize("moment", ["start", "stop"])
def test_the_control_process_obeys_the_signal(twin, monkeypatch, moment):
    for name in ("_raise_priority", "limit_jax_to_one_thread"):
        monkeypatch.setattr(process, name, lambda: None)
    control = Mock(limits=RequestLimits.of(twin, ()), strategies=(), standstill="")
    triggered = []

    def come():
        signal_this_process()
        triggered.append(EMERGENCY_STOP.is_triggered)

    getattr(control, moment).side_effect = come
    ours, theirs = multiprocessing.Pipe()
    ours.send(("stop", ()))
    process._run_control(lambda: control, theirs)
    assert triggered == [True]


@pytest.mark.parametrize("moment", ["opening", "run", "return"])
def test_the_process_of_the_page_passes_the_signal_on(monkeypatch, moment):
    pytest.importorskip("viser")
    page, wait = Mock(latest=None), Mock()
    page.gate.address = "nowhere"
    moments = {"opening": page.wait_until_ready, "run": wait, "return": page.stop}
    moments[moment].side_effect = signal_this_process
    monkeypatch.setattr("s2c2a.live.process.ControlProcess", lambda *_: page)
    monkeypatch.setattr("s2c2a.live.page.LivePage", lambda *_: page)
    monkeypatch.setattr(command, "wait_for_interrupt", wait)
    command.live()
    page.stop_at_once.assert_called_once()
