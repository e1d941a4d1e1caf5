"""Registers of an STS3215: several turns, signs, the lock, shutdown."""

import pytest
from named_registers import read, write

from s2c2a.lab.emulation.servo import MotorState
from s2c2a.lab.emulation.sts3215 import STS3215


@pytest.fixture
def servo():
    return STS3215(1, MotorState(ticks=5000.0, voltage=7.4))


def count_turns(servo):
    write(servo, "min_position", 0)
    write(servo, "max_position", 0)


def test_the_position_stays_within_a_turn_unless_both_angle_limits_are_zero(servo):
    servo.update(MotorState(ticks=9000.0, voltage=7.4), 0.01, 0.0)
    assert read(servo, "present_position") == 9000 % 4096
    count_turns(servo)
    assert read(servo, "present_position") == 9000 - 4096


def test_negative_positions_are_sign_and_magnitude(servo):
    count_turns(servo)
    servo.update(MotorState(ticks=4096.0 - 5.0, voltage=7.4), 0.01, 0.0)
    assert servo.read(56, 2) == b"\x05\x80"
    servo.write(42, b"\x05\x80")
    assert servo.command().goal == 4096 - 5


def test_a_goal_beyond_the_angle_limits_is_limited(servo):
    write(servo, "max_position", 2000)
    write(servo, "goal_position", 3000)
    assert servo.command().goal == 4096 + 2000


def test_changes_under_the_lock_are_lost_in_a_restart(servo):
    write(servo, "id", 5)
    servo.restart(0.0)
    assert servo.id == 1
    write(servo, "lock", 0)
    write(servo, "id", 5)
    write(servo, "lock", 1)
    servo.restart(0.0)
    assert servo.id == 5


def test_measurements_have_the_units_of_the_manual(servo):
    state = MotorState(ticks=5000.0, velocity=-1.0, current=-0.65, voltage=7.2)
    servo.update(state, 0.01, 0.0)
    assert read(servo, "present_speed") == -652
    assert read(servo, "present_current") == -100
    assert read(servo, "present_voltage") == 72


def test_an_overheated_servo_switches_off_until_a_restart(servo):
    write(servo, "torque_enable", 1)
    servo.temperature = 80.0
    servo.update(MotorState(voltage=7.4), 0.01, 0.0)
    assert servo.errors == ("overheating",)
    write(servo, "torque_enable", 1)
    assert not servo.torque
