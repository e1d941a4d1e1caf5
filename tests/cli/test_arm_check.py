"""The command `arm check` names the hardware of an arm file."""

import pytest

from s2c2a.arm import Tracking, load_arm, save_arm, servos_of
from s2c2a.arm.sensors import Inertial
from s2c2a.cli.arm import check
from s2c2a.errors import S2C2AError


@pytest.fixture
def checked(twin, tmp_path, capsys):
    """Check an arm with changes, the twin by default; return what is printed."""

    def run(arm=twin, **changes) -> str:
        path = tmp_path / "mine.toml"
        save_arm(arm.model_copy(update=changes), path, overwrite=True)
        check(str(path))
        return capsys.readouterr().out

    return run


def test_servos_and_tracking_of_an_arm_file_are_named(twin, checked):
    servos = servos_of(twin).model_copy(update={"port": "/dev/ttyUSB0"})
    tracking = Tracking(source="natnet:10.0.0.2", ends=("", "", "tip"))
    output = checked(servos=servos, tracking=tracking)
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
def test_a_sensor_that_does_not_exist_is_refused(sensing, reason, checked):
    with pytest.raises(S2C2AError, match=reason):
        checked(sensing=sensing)


def test_a_package_that_a_sensor_needs_is_asked_for(twin, checked, monkeypatch):
    sensors = twin.sensors.model_copy(update={"imu": Inertial()})
    monkeypatch.setattr("s2c2a.cli.arm.find_spec", lambda name: None)
    output = checked(sensors=sensors)
    assert "further sensors: imu" in output
    assert "[sensors.imu] needs the package vqf" in output


def test_unusual_values_are_asked_about(twin, checked):
    module = twin.modules[0].model_copy(update={"damping_time": 0.005})
    output = checked(modules=(module,) * 3)
    assert "unusual: a damping ratio below 0.03" in output
    assert "unusual:" not in checked()  # the path has the name of this test


def test_check_says_how_far_pressures_bend_an_arm(checked):
    arm = load_arm("pneumatic_arm")
    weak = arm.modules[1].model_copy(update={"chamber_area": 3e-5})
    out = checked(arm, modules=(arm.modules[0], weak))
    assert "full pressure_limit bends the modules by about 46, 5 deg" in out
    assert "bend_limit_deg: 70, 70" in out
