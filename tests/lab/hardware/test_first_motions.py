"""First motions of an arm whose servos reach their goals at once."""

from dataclasses import replace

import pytest
from fake_servo_bus import SOUND, FakeServoBus
from homes import calibration_with
from servos_in_memory import Clock

from s2c2a.arm import load_arm, servos_of
from s2c2a.errors import RobotError
from s2c2a.lab.hardware import bring_up, servo_robot
from s2c2a.lab.hardware.bring_up import BringUp
from s2c2a.lab.hardware.bus import BusError
from s2c2a.lab.hardware.calibration import save_calibration
from s2c2a.lab.hardware.servo_robot import DynamixelRobot

ARM = load_arm("twin_arm")
IDS = range(1, 10)
CALIBRATION = calibration_with(ARM, dict.fromkeys(IDS, 0))


def test_a_jog_asks_only_the_servo_that_moves(monkeypatch):
    monkeypatch.setattr(bring_up, "STILL_TIME", 0.0)
    bus = FakeServoBus([4], Clock())
    moved = BringUp(bus, ARM, lambda _: True, print).jog(4, 0.003)
    assert moved == pytest.approx(0.003, abs=1e-4)
    assert [ids for ids, _ in bus.prepared] == [(4,)]


def test_no_servo_keeps_its_torque_when_one_fails_to_switch_on(monkeypatch):
    bus = FakeServoBus(IDS, Clock())

    def switch_all_but_the_last(ids, on):
        bus.torques |= dict.fromkeys(ids[:-1] if on else ids, on)
        if on:
            raise BusError("servo 9 does not answer")

    bus.set_torque = switch_all_but_the_last
    with pytest.raises(BusError, match="servo 9"):
        BringUp(bus, ARM, lambda _: True, print).home(bus.scan(IDS))
    assert not any(bus.torques.values())


def test_homing_names_servos_that_do_not_answer_before_anything_moves():
    bus = FakeServoBus(IDS, Clock())
    with pytest.raises(BusError, match=r"no answer from servos \[8, 9\]"):
        BringUp(bus, ARM, lambda _: True, print).home(bus.scan(range(1, 8)))
    assert bus.torques == {}


def test_a_check_does_not_move_an_arm_whose_calibration_does_not_fit():
    servos = servos_of(ARM)
    limits = servos.limits.model_copy(update={"displacement": 0.01})
    table = servos.model_copy(update={"limits": limits})
    arm = ARM.model_copy(update={"servos": table})
    bus = FakeServoBus(IDS, Clock())
    bus.states[5] = replace(SOUND, position=2000)
    with pytest.raises(RobotError, match=r"servos \[5\] stand at"):
        BringUp(bus, arm, lambda _: True, print).check(CALIBRATION)
    assert bus.states[5].position == 2000
    assert not any(bus.torques.values())


def test_an_arm_file_with_other_ticks_than_its_servos_moves_nothing(
    monkeypatch, tmp_path
):
    path = tmp_path / "homes.json"
    save_calibration(CALIBRATION, path)
    motor = ARM.motor.model_copy(update={"ticks_per_turn": 1024})
    arm = ARM.model_copy(update={"motor": motor})
    bus = FakeServoBus(IDS, Clock())
    monkeypatch.setattr(servo_robot, "open_bus", lambda *_: bus)
    message = "is 1024; its servos have 4096"
    with pytest.raises(BusError, match=message):
        DynamixelRobot(arm, calibration=str(path)).open()
    with pytest.raises(BusError, match=message):
        BringUp(bus, arm, lambda _: True, print)
    assert not bus.prepared
