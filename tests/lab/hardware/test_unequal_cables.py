"""Servos of arms whose modules have two cables, none, or different numbers of them."""

import numpy as np
import pytest
from arm_on_a_wire import ArmOnAWire

from s2c2a.arm import load_arm, save_arm, servos_of
from s2c2a.arm.files import arm_from_toml, arm_to_toml
from s2c2a.arm.geometry import cables_present
from s2c2a.errors import ArmError
from s2c2a.lab.cli import motors
from s2c2a.lab.hardware.calibration import load_calibration

ANGLES = {
    "planar": [[0.0, 180.0], [0.0, 180.0], [0.0, 180.0]],
    "mixed": [[90.0, 210.0, 330.0], [], [0.0, 180.0]],
    "growing": [[0.0, 180.0], [90.0, 210.0, 330.0], [0.0, 90.0, 180.0, 270.0]],
}


def arm_with(kind, **servos):
    """An arm with the cables of a kind, whose servos have ids in the order of cables."""
    arm = load_arm("twin_arm")
    modules = [
        module.model_dump() | {"cable_angles_deg": angles}
        for module, angles in zip(arm.modules, ANGLES[kind], strict=True)
    ]
    arm = type(arm).model_validate(arm.model_dump() | {"modules": modules})
    table = servos_of(arm).model_dump() | servos
    return type(arm).model_validate(arm.model_dump() | {"servos": table})


@pytest.fixture(params=ANGLES)
def arm(request):
    return arm_with(request.param)


def test_ids_count_the_cables_that_exist(arm):
    ids = [id for row in servos_of(arm).ids for id in row]
    assert ids == list(range(1, cables_present(arm).sum() + 1))
    assert arm_from_toml(arm_to_toml(arm)) == arm


def test_an_arm_file_with_a_wrong_number_of_ids_is_refused():
    text = arm_to_toml(arm_with("mixed"))
    with pytest.raises(ArmError, match=r"rows of lengths \[3, 0, 1\].*\[3, 0, 2\]"):
        arm_from_toml(text.replace("4,\n", "").replace("[3, 0, 2]", ""))


@pytest.mark.slow
def test_the_robot_follows_commands_and_reads_zeros_without_a_cable(
    emulator, tmp_path, arm
):
    wire = ArmOnAWire(emulator, tmp_path, arm=arm)
    absent = ~cables_present(arm)
    with wire.driven():
        records = wire.steps(12)
    assert not any(record.fault for record in records)
    assert max(np.abs(record.action).max() for record in records) > 0.002
    assert wire.largest_error(wire.records) < 0.003
    assert all((record.reading["cables"][absent] == 0).all() for record in records)
    assert all((record.action[absent] == 0).all() for record in records)
    wire.check_limits()


def test_homing_finds_the_slack_of_every_cable(emulator, tmp_path, arm, capsys):
    path = tmp_path / "arm.toml"
    save_arm(arm, path)
    port = tmp_path / "port"
    emulator.start(path, port)  # slack in every cable
    out = tmp_path / "homes.json"
    motors.home(str(path), str(port), out, repeat=1, yes=True)
    motors.check(str(path), str(port), out, yes=True)
    present = cables_present(arm)
    said = capsys.readouterr().out
    assert f"all {present.sum()} cables move as they should" in said
    assert ("no cables, skipped" in said) == (not present.any(axis=-1).all())
    status = emulator.status()
    assert status["largest_current"] <= 1.05 * servos_of(arm).limits.current
    places = [servo["displacement"] for servo in status["servos"]]
    assert np.abs(places).max() < 0.001
    homes = load_calibration(out, arm).home(arm)[present]
    true = [winch.home_ticks for winch in emulator._emulator.winches]
    tick = 2 * np.pi * arm.motor.pulley_radius / arm.motor.ticks_per_turn
    assert np.abs((homes - true) * tick).max() < 0.002


def test_a_directions_row_belongs_to_a_module(emulator, tmp_path):
    directions = [[1, -1, 1], [], [-1, 1]]
    wire = ArmOnAWire(emulator, tmp_path, arm=arm_with("mixed", directions=directions))
    with wire.driven():
        wire.steps(6)
    assert wire.largest_error(wire.records) < 0.003
