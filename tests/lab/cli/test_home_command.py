"""The command `motors home` judges the calibration that it made."""

from contextlib import nullcontext
from datetime import UTC, datetime

import pytest

from s2c2a.errors import S2C2AError
from s2c2a.lab.cli import motors
from s2c2a.lab.hardware.bring_up import BringUp
from s2c2a.lab.hardware.calibration import CalibratedServo, Calibration


class NoBus:
    has_watchdog = True
    ticks_per_turn = 4096

    def torque_constant_of(self, id):
        return 0.35

    def scan(self, ids):
        return []


@pytest.fixture
def home_with(monkeypatch, tmp_path):
    """Run the command on an arm whose homings have a spread [m]."""

    def run(spread):
        servo = CalibratedServo(
            id=1, model="xl330-m288", firmware=52, home=0, spread=spread
        )
        made = Calibration(arm="twin_arm", date=datetime.now(UTC), servos=(servo,))
        monkeypatch.setattr(BringUp, "home", lambda *_, **__: made)
        monkeypatch.setattr(motors, "_opened", lambda *_: nullcontext(NoBus()))
        motors.home(out=tmp_path / "homes.json", yes=True)

    return run


@pytest.mark.parametrize("spread", [None, 0.0001])
def test_a_repeatable_calibration_is_accepted(home_with, spread, capsys):
    home_with(spread)
    assert "homes.json" in capsys.readouterr().out


def test_homings_that_differ_are_refused(home_with):
    with pytest.raises(S2C2AError, match=r"differ by 13\.7 mm"):
        home_with(0.01367)


def test_a_slow_adapter_is_reported(monkeypatch, capsys):
    monkeypatch.setattr("s2c2a.lab.hardware.serial_line.latency_of", lambda port: 0.016)
    motors._print_slow_adapter("/dev/ttyUSB0")
    assert "keeps bytes for 16 ms" in capsys.readouterr().out
    monkeypatch.setattr("s2c2a.lab.hardware.serial_line.latency_of", lambda port: 0.001)
    motors._print_slow_adapter("/dev/ttyUSB0")
    assert capsys.readouterr().out == ""
