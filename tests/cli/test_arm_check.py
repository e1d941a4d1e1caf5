"""The command `arm check` names the hardware of an arm file."""

from s2c2a.arm import Tracking, load_arm, save_arm, servos_of
from s2c2a.cli.arm import check


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
