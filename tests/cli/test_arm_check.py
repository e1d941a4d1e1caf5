"""The command `arm check` names the hardware of an arm file."""

import pytest

from s2c2a.arm import Tracking, load_arm, save_arm, servos_of
from s2c2a.arm.sensors import Inertial
from s2c2a.cli.arm import check
from s2c2a.errors import S2C2AError


def test_servos_and_tracking_of_an_arm_file_are_named(tmp_path, capsys):
    twin = load_arm("twin_arm")
    servos = servos_of(twin).model_copy(update={"port": "/dev/ttyUSB0"})
    tracking = Tracking(source="natnet:10.0.0.2", ends=("", "", "tip"))
    path = tmp_path / "mine.toml"
    save_arm(twin.model_copy(update={"servos": servos, "tracking": tracking}), path)
    check(str(path))
    output = capsys.readouterr().out
    assert "servos: 9 xl330-m288 (dynamixel) on /dev/ttyUSB0" in output
    assert "tracking: base, tip by natnet:10.0.0.2" in output


@pytest.mark.parametrize(
    ("sensing", "reason"),
    [
        ("mocap", "no sensor 'mocap'; choose one of encoders, true"),
        ("nofile.py:Map", "there is no file nofile.py"),
        (
            "builtins:int",
            "is no sensor; derive it from s2c2a.estimation.*ConfigurationMap",
        ),
    ],
)
def test_a_sensor_that_does_not_exist_is_refused(sensing, reason, tmp_path):
    path = tmp_path / "mine.toml"
    twin = load_arm("twin_arm")
    save_arm(twin.model_copy(update={"sensing": sensing}), path)
    with pytest.raises(S2C2AError, match=reason):
        check(str(path))


def test_a_package_that_a_sensor_needs_is_asked_for(tmp_path, capsys, monkeypatch):
    twin = load_arm("twin_arm")
    sensors = twin.sensors.model_copy(update={"imu": Inertial()})
    path = tmp_path / "mine.toml"
    save_arm(twin.model_copy(update={"sensors": sensors}), path)
    monkeypatch.setattr("s2c2a.cli.arm.find_spec", lambda name: None)
    check(str(path))
    assert "[sensors.imu] needs the package vqf" in capsys.readouterr().out


def test_unusual_values_are_asked_about(tmp_path, capsys):
    twin = load_arm("twin_arm")
    modules = [
        module.model_copy(update={"damping_time": 0.005}) for module in twin.modules
    ]
    path = tmp_path / "mine.toml"
    save_arm(twin.model_copy(update={"modules": tuple(modules)}), path)
    check(str(path))
    assert "unusual: a damping ratio below 0.03" in capsys.readouterr().out
    check("twin_arm")
    assert "unusual" not in capsys.readouterr().out


def test_check_says_how_far_pressures_bend_an_arm(tmp_path, capsys):
    arm = load_arm("pneumatic_arm")
    weak = arm.modules[1].model_copy(update={"chamber_area": 3e-5})
    modules = (arm.modules[0], weak)
    path = tmp_path / "weak.toml"
    save_arm(arm.model_copy(update={"modules": modules}), path)
    check(str(path))
    out = capsys.readouterr().out
    assert "full pressure_limit bends the modules by about 46, 5 deg" in out
    assert "bend_limit_deg: 70, 70" in out
