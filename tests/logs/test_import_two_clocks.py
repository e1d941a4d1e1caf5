"""Command `s2c2a import`: motors and camera in two files with clocks of their own."""

import re

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from s2c2a.arm import load_arm
from s2c2a.cli.main import main
from s2c2a.data import load_recording
from s2c2a.robots.simulation import SimulatedRobot

SPAN = 45.0  # s
RATE = 50.0  # Hz, of the simulation
OFFSET = 99.63  # s, motors minus camera
DRIFT = 50e-6
RADIUS = 0.027  # m
DIRECTIONS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
MAP = """
[rows]
kind = "timed"
time = "stamp"
[join]
by = "time"
files = 2
times = ["stamp", "seconds"]
[arm]
name = "one"
modules = 1
control_rate = 10
lengths = [0.25]
{drives}
[[ends]]
position = ["x", "y", "z"]
unit = "mm"
[frame]
along = "z"
x = "x"
base = [0, 0, 0]
"""
DRIVE = """
[[drives]]
measured = "m{cable}"
unit = "mm"
positive = "pulls"
module = 0
angle_deg = {angle}
"""


@pytest.fixture(scope="module")
def folder(make_arm, tmp_path_factory):
    """Two logs of a simulated module, with their map."""
    folder = tmp_path_factory.mktemp("two_clocks")
    arm = make_arm(modules=1, cables=4, module={"length": 0.25}, control_rate=RATE)
    time, cables, tip = simulate(SimulatedRobot(arm, seed=0))
    random = np.random.default_rng(1)
    motor_time = np.arange(0.1, SPAN - 0.1, 0.1)
    cables = sample(motor_time, time, -1e3 * cables)  # a displacement lengthens
    write(folder / "motors.csv", "stamp,m0,m1,m2,m3", motor_time, cables)
    true_time = np.arange(0.5, SPAN - 0.5, 0.04)
    tip = sample(true_time, time, 1e3 * tip)
    tip += random.normal(0.0, 0.2, tip.shape)
    camera_time = (true_time - OFFSET) / (1 + DRIFT)
    write(folder / "camera.csv", "seconds,x,y,z", camera_time, tip)
    drives = [DRIVE.format(cable=cable, angle=90 * cable) for cable in range(4)]
    text = MAP.format(drives="".join(drives))
    (folder / "map.toml").write_text(text, encoding="utf-8")
    return folder


def simulate(robot):
    """Times, cables, and positions of the tip during smooth random motion."""
    random = np.random.default_rng(0)
    knots = np.arange(0.0, SPAN + 2.0)
    targets = random.uniform(-0.6, 0.6, (len(knots), 2))
    targets[0] = 0.0
    bends = PchipInterpolator(knots, targets)
    readings = [robot.open()]
    for step in range(int(SPAN * RATE)):
        action = RADIUS * bends(step / RATE) @ DIRECTIONS.T
        robot.send(action[None])
        robot.advance(1 / RATE)
        readings.append(robot.read())
    time = np.array([reading.time for reading in readings])
    cables = np.array([reading.sensors["cables"][0] for reading in readings])
    states = np.array([reading.sensors["states"][0] for reading in readings])
    return time, cables, states[:, :3]


def sample(samples, time, values):
    return np.stack([np.interp(samples, time, channel) for channel in values.T], 1)


def write(path, header, time, values):
    table = np.column_stack([time, values])
    np.savetxt(path, table, "%.6f", ",", header=header, comments="")


def true_offset(camera_time):
    return OFFSET + DRIFT * camera_time


@pytest.mark.slow
def test_two_files_of_a_simulated_arm_become_a_recording(folder, capsys):
    logs = [str(folder / "motors.csv"), str(folder / "camera.csv")]
    out = folder / "one.episodes"
    main(["import", *logs, "--map", str(folder / "map.toml"), "--out", str(out)])
    output = capsys.readouterr().out
    line = re.search(r"clock of file 2: ([+-][\d.]+) s \+- ([\d.]+) ms", output)
    assert line is not None
    error = abs(float(line.group(1)) - true_offset(SPAN / 2 - OFFSET))
    assert error < 0.01
    assert error < 3e-3 * float(line.group(2))
    recording = load_recording(out)
    positions = recording.sensor("states").reshape(-1, 6)[:, :3]
    assert np.isfinite(positions).all(axis=1).mean() > 0.95
    arm = load_arm(folder / "one.arm.toml")
    assert arm.modules[0].length == pytest.approx(0.25, rel=0.02)
