"""SIGUSR1 stops the arm of the live page, from its opening until it is at rest."""

import multiprocessing
import os
import signal
import sys

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


class _Control:
    """A control of no arm, during one call of which the signal comes."""

    strategies = ()
    standstill = ""

    def __init__(self, arm, moment):
        self.limits = RequestLimits.of(arm, ())
        self.moment = moment
        self.triggered = {}

    def watch(self, watcher):
        pass

    def prepare(self):
        pass

    def start(self):
        self._come("start")

    def stop(self):
        self._come("stop")

    def _come(self, moment):
        if moment == self.moment:
            signal_this_process()
        self.triggered[moment] = EMERGENCY_STOP.is_triggered


@pytest.mark.parametrize("moment", ["start", "stop"])
def test_the_control_process_obeys_the_signal(twin, monkeypatch, moment):
    for name in ("_raise_priority", "limit_jax_to_one_thread"):
        monkeypatch.setattr(process, name, lambda: None)
    control = _Control(twin, moment)
    ours, theirs = multiprocessing.Pipe()
    ours.send(("stop", ()))
    process._run_control(lambda: control, theirs)
    assert control.triggered[moment]


class _Page:
    """A page, and the control behind it, that open and close at once."""

    def __init__(self, moment):
        self.moment = moment
        self.stops = 0
        self.latest = None
        self.gate = self
        self.address = "nowhere"

    def stop_at_once(self):
        self.stops += 1

    def wait_until_ready(self):
        if self.moment == "opening":
            signal_this_process()

    def stop(self):
        if self.moment == "return":
            signal_this_process()

    def close(self):
        pass


@pytest.mark.parametrize("moment", ["opening", "run", "return"])
def test_the_process_of_the_page_passes_the_signal_on(monkeypatch, moment):
    pytest.importorskip("viser")
    page = _Page(moment)
    monkeypatch.setattr("s2c2a.live.process.ControlProcess", lambda *_: page)
    monkeypatch.setattr("s2c2a.live.page.LivePage", lambda *_: page)

    def wait():
        if moment == "run":
            signal_this_process()

    monkeypatch.setattr(command, "wait_for_interrupt", wait)
    command.live()
    assert page.stops == 1
