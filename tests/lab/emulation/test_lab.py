"""A whole laboratory, emulated: files, and a recording through both wires."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from homes import calibration_with
from streams import PATIENCE, free_port, wait_until

from s2c2a import data
from s2c2a.arm import load_arm
from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.lab import open_lab
from s2c2a.lab.emulation.motive import MotiveOptions
from s2c2a.lab.emulation.outputs import describe
from s2c2a.lab.hardware.calibration import (
    default_path,
    save_calibration,
)
from s2c2a.robots import RobotFactory
from s2c2a.spaces import POSITION

MOCAP = MotiveOptions(command_port=2510, data_port=2511)


def test_the_arm_file_of_a_laboratory_names_its_port_and_its_tracker(tmp_path):
    laboratory = open_lab(load_arm("twin_arm"), tmp_path / "lab", MOCAP)
    arm = load_arm(tmp_path / "lab" / "arm.toml")
    assert arm.servos.port == str(tmp_path / "lab" / "port")
    assert arm.tracking.source == "natnet:127.0.0.1,command_port=2510,data_port=2511"
    assert not arm.differences(load_arm("twin_arm"))
    assert "9 dynamixel servos" in laboratory.welcome


def test_an_arm_file_of_the_user_is_not_replaced(tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text("# mine\n")
    with pytest.raises(S2C2AError, match="choose another --folder"):
        open_lab(load_arm("twin_arm"), tmp_path, MOCAP)
    assert path.read_text() == "# mine\n"
    path.unlink()
    open_lab(load_arm("twin_arm"), tmp_path, MOCAP)
    open_lab(load_arm("twin_both"), tmp_path, MOCAP)
    assert load_arm(path).name == "twin_both-lab"


@pytest.mark.parametrize("text", ["mine", '{"mine": 1}', "[1]", "[" * 100_000])
def test_a_status_file_of_the_user_is_not_replaced(tmp_path, text):
    (tmp_path / "status.json").write_text(text)
    with pytest.raises(S2C2AError, match=r"status\.json is not the status"):
        open_lab(load_arm("twin_arm"), tmp_path, MOCAP)
    assert [path.name for path in tmp_path.iterdir()] == ["status.json"]


def test_the_status_file_of_a_killed_laboratory_is_replaced(tmp_path):
    emulator = open_lab(load_arm("twin_arm"), tmp_path, MOCAP).emulator
    (tmp_path / "status.json").write_text(json.dumps(describe(emulator)))
    open_lab(load_arm("twin_arm"), tmp_path, MOCAP)


def test_a_folder_in_use_is_refused(tmp_path):
    (tmp_path / "port").symlink_to("/dev/null")
    with pytest.raises(S2C2AError, match="another laboratory uses this folder"):
        open_lab(load_arm("twin_arm"), tmp_path, MOCAP)


@pytest.fixture
def laboratory(tmp_path, monkeypatch):
    """A running laboratory, whose arm is homed, in the current folder."""
    monkeypatch.chdir(tmp_path)
    command = [sys.executable, "-m", "s2c2a", "emulate", "lab", "--homed"]
    command += ["--mocap-port", str(free_port() + 1), "--mocap-latency", "0.03"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, process.pid, -10)
    assert "9 dynamixel servos" in process.stdout.readline()
    save_homes(tmp_path / "lab" / "status.json")
    yield load_arm("lab/arm.toml")
    process.send_signal(signal.SIGTERM)
    assert process.wait(PATIENCE) == 0
    process.stdout.close()


def save_homes(status_file):
    wait_until(status_file.exists)
    servos = json.loads(status_file.read_text())["servos"]
    homes = {servo["id"]: servo["position"] for servo in servos}
    arm = load_arm("lab/arm.toml")
    save_calibration(calibration_with(arm, homes), default_path(arm))


def test_a_laboratory_is_recorded_as_a_real_arm_is(laboratory):
    factory = RobotFactory("dynamixel")
    recording = data.collect(
        Path("lab.episodes"),
        laboratory,
        partial(factory.seeded, laboratory),
        data.CollectOptions(episodes=1, samples=30),
        threads=1,
    )
    states = recording.sensor("states")
    assert np.isfinite(states).all(axis=(-1, -2)).mean() > 0.8
    tips = states[..., -1, POSITION]
    assert np.nanmax(np.abs(tips - [0, 0, laboratory.length])) < laboratory.length
    assert np.nanstd(tips, axis=-2).max() > 0.001
    assert (recording.sensor("states_age") >= 0.0).sum() > 20
