"""The signal SIGUSR1 reaches the control loop of every command that drives an arm."""

import os
import signal

import pytest

from s2c2a import data, jobs
from s2c2a.cli.collect import collect
from s2c2a.cli.run import run
from s2c2a.runtime import EMERGENCY_STOP, EmergencyStopError

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="needs SIGUSR1")


@pytest.fixture(autouse=True)
def reset_afterwards():
    yield
    EMERGENCY_STOP.reset()


def signal_this_process(*_, **__):
    os.kill(os.getpid(), signal.SIGUSR1)
    EMERGENCY_STOP.check()


def test_a_signal_stops_a_recording(monkeypatch, tmp_path):
    monkeypatch.setattr(data, "collect", signal_this_process)
    with pytest.raises(EmergencyStopError, match="SIGUSR1"):
        collect(tmp_path / "arm.episodes")


def test_a_signal_stops_a_run(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(jobs, "make_all", signal_this_process)
    with pytest.raises(EmergencyStopError, match="SIGUSR1"):
        run("circle", strategy=("pcc",))
