"""Command `s2c2a import`: motors and camera in two files with clocks of their own."""

import re

import numpy as np
import pytest
from moving_arm import LENGTHS, two_clocks

from s2c2a.arm import load_arm
from s2c2a.cli.main import main
from s2c2a.data import load_recording

SPAN = 45.0  # s
OFFSET = 99.63  # s, motors minus camera
MAP = """
[rows]
kind = "timed"
time = "stamp"
[join]
by = "time"
files = 2
times = ["stamp", "seconds"]
[arm]
name = "two"
modules = 2
control_rate = 10
length = {length}
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
module = {module}
angle_deg = {angle}
"""


def write(path, header, motion):
    table = np.column_stack([motion.time, 1e3 * motion.values])
    np.savetxt(path, table, "%.6f", ",", header=header, comments="")


@pytest.mark.slow
def test_two_files_of_a_moving_arm_become_a_recording(tmp_path, capsys):
    log = two_clocks(0, offset=OFFSET, span=SPAN)
    motors, camera, out = (
        tmp_path / name for name in ("motors.csv", "camera.csv", "two.episodes")
    )
    write(motors, ",".join(["stamp", *(f"m{cable}" for cable in range(8))]), log.drives)
    write(camera, "seconds,x,y,z", log.tip)
    drives = [
        DRIVE.format(cable=cable, module=cable // 4, angle=90 * (cable % 4))
        for cable in range(8)
    ]
    text = MAP.format(length=LENGTHS.sum(), drives="".join(drives))
    (tmp_path / "map.toml").write_text(text)
    paths = [str(path) for path in (motors, camera, tmp_path / "map.toml", out)]
    main(["import", *paths[:2], "--map", paths[2], "--out", paths[3]])
    line = re.search(
        r"clock of file 2: ([+-][\d.]+) s \+- ([\d.]+) ms", capsys.readouterr().out
    )
    assert line is not None
    true = OFFSET + 50e-6 * (SPAN / 2 - OFFSET)
    error = abs(float(line.group(1)) - true)
    assert error < 0.01
    assert error < 3e-3 * float(line.group(2))
    positions = load_recording(out).sensor("states")[..., -1, :3]
    assert np.isfinite(positions).all(axis=-1).mean() > 0.95
    arm = load_arm(tmp_path / "two.arm.toml")
    assert arm.length == pytest.approx(LENGTHS.sum(), rel=0.02)
