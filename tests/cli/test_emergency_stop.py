"""The signal SIGUSR1 reaches the control loop of every command that drives an arm."""

import importlib
import inspect
import os
import pkgutil
import signal
from functools import partial
from pathlib import Path

import pytest

from s2c2a.cli.arm import check_contract
from s2c2a.cli.collect import collect
from s2c2a.cli.run import run
from s2c2a.lab.cli.tracking_calibration import frames, latency
from s2c2a.runtime import EMERGENCY_STOP, EmergencyStopError

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="needs SIGUSR1")


def signal_this_process(*_, **__):
    os.kill(os.getpid(), signal.SIGUSR1)
    EMERGENCY_STOP.check()


MOTIONS = "s2c2a.lab.tracking.calibration_motions"
TRACKED = {"arm": "twin_arm", "robot": "sim", "tracking": "udp:9763"}


@pytest.mark.parametrize(
    ("work", "command"),
    [
        ("s2c2a.data.collect", partial(collect, Path("arm.episodes"))),
        ("s2c2a.jobs.make_all", partial(run, "circle", strategy=("pcc",))),
        ("s2c2a.runtime.check_robot", check_contract),
        (f"{MOTIONS}.measure_latency", partial(latency, **TRACKED)),
        (f"{MOTIONS}.measure_frames", partial(frames, **TRACKED)),
    ],
)
def test_a_signal_stops_a_command(work, command, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(work, signal_this_process)
    monkeypatch.setattr("s2c2a.lab.tracking.tracker_of", lambda source: None)
    with pytest.raises(EmergencyStopError, match="SIGUSR1"):
        command()


def takes_a_robot(command) -> bool:
    """Whether a command has the options of a robot, by itself or in an object of options."""
    parameters = inspect.signature(command).parameters
    given = (parameter.default for parameter in parameters.values())
    return "robot_option" in parameters or any(
        hasattr(value, "robot_option") for value in given
    )


def test_no_command_that_moves_an_arm_is_forgotten_here():
    wings = ("lab", "logs", "live", "integrations")
    names = ["s2c2a.cli", *(f"s2c2a.{wing}.cli" for wing in wings), "s2c2a_experiments"]
    modules = [
        importlib.import_module(f"{name}.{module.name}")
        for name in names
        for module in pkgutil.iter_modules(importlib.import_module(name).__path__)
    ]
    moving = {
        name
        for module in modules
        for name, function in inspect.getmembers(module, inspect.isfunction)
        if function.__module__ == module.__name__ and takes_a_robot(function)
    }
    here = {"collect", "run", "check_contract", "latency", "frames", "session"}
    # `live` and `ros` obey the signal in their control process; `motors` has its own
    # tests (hardware/test_motors_in_memory.py)
    assert moving == here | {"live", "ros"}
