"""Registers of an XL330-M288: locks, limits, indirect data, watchdog, shutdown."""

import math

import pytest
from named_registers import read, write

from s2c2a.lab.emulation.servo import MotorState, RefusalError
from s2c2a.lab.emulation.xl330 import XL330

TORQUE = 64
CHUNK = 0.01  # s


@pytest.fixture
def servo():
    return XL330(3, MotorState(ticks=5000.0))


def update(servo, now=0.0, seconds=CHUNK, **state):
    servo.update(MotorState(**state), seconds, now)


@pytest.mark.parametrize("mode", [0, 1, 2, 16])
def test_an_operating_mode_that_does_not_wind_to_positions_is_refused(servo, mode):
    with pytest.raises(RefusalError, match="out of range"):
        write(servo, "operating_mode", mode)


def test_a_write_over_several_registers_is_whole_or_not_at_all(servo):
    profile = (10).to_bytes(4, "little") + (100_000).to_bytes(4, "little")
    with pytest.raises(RefusalError, match="out of range"):
        servo.write(108, profile)
    assert read(servo, "profile_acceleration") == 0


def test_goals_beyond_their_limits_are_refused(servo):
    write(servo, "current_limit", 600)
    write(servo, "goal_current", 600)
    with pytest.raises(RefusalError, match="configured limit"):
        write(servo, "goal_current", 601)
    with pytest.raises(RefusalError, match="configured limit"):
        write(servo, "goal_position", 5000)
    write(servo, "operating_mode", 4)
    write(servo, "goal_position", 5000)


@pytest.mark.parametrize(("firmware", "data"), [(52, 208), (51, 224), (45, 224)])
def test_indirect_data_stand_for_the_registers_that_they_point_to(firmware, data):
    servo = XL330(1, MotorState(ticks=700.0), firmware)
    for number, address in enumerate([*range(132, 136), TORQUE]):
        write(servo, f"indirect_address_{number + 1}", address)
    assert servo.read(data, 4) == (700).to_bytes(4, "little")
    servo.write(data + 4, b"\x01")
    assert servo.torque


def test_an_indirect_write_of_a_part_of_a_register_is_refused(servo):
    write(servo, "indirect_address_1", 116)
    with pytest.raises(RefusalError, match="part of a register"):
        servo.write(208, b"\x01")


def test_the_bus_watchdog_stops_the_motor_and_freezes_the_goals(servo):
    write(servo, "operating_mode", 4)
    write(servo, "torque_enable", 1)
    write(servo, "bus_watchdog", 5)
    servo.hear(1.0)
    write(servo, "goal_position", 9000)
    update(servo, 1.09, ticks=5200.0)
    assert not servo.watchdog_tripped
    update(servo, 1.11, ticks=5300.0)
    assert servo.watchdog_tripped
    assert servo.command().goal == 5300
    with pytest.raises(RefusalError, match="out of range"):
        write(servo, "goal_position", 9000)
    write(servo, "bus_watchdog", 0)
    write(servo, "goal_position", 9000)
    assert servo.command().goal == 9000 + 4096


def test_a_restart_loses_turns_and_volatile_registers(servo):
    write(servo, "operating_mode", 4)
    write(servo, "torque_enable", 1)
    write(servo, "bus_watchdog", 20)
    update(servo, ticks=9000.0)
    assert read(servo, "present_position") == 9000 - 4096
    servo.restart(1.0)
    assert read(servo, "present_position") == 9000 - 2 * 4096
    assert read(servo, "operating_mode") == 4
    assert read(servo, "torque_enable") == 0
    assert read(servo, "bus_watchdog") == 0


def test_goals_keep_their_meaning_after_a_restart(servo):
    write(servo, "operating_mode", 4)
    servo.restart(0.0)
    write(servo, "goal_position", 1000)
    assert servo.command().goal == 4096 + 1000


def test_torque_returns_to_a_goal_that_was_left(servo):
    write(servo, "operating_mode", 4)
    write(servo, "torque_enable", 1)
    write(servo, "goal_position", 2000)
    write(servo, "torque_enable", 0)
    update(servo, ticks=7000.0)
    write(servo, "torque_enable", 1)
    assert servo.command().goal == 2000 + 4096


def test_goal_current_limits_the_current_in_current_based_position_mode(servo):
    write(servo, "goal_current", 60)
    assert servo.command().current == pytest.approx(1.75)
    write(servo, "operating_mode", 5)
    write(servo, "goal_current", 60)
    assert servo.command().current == pytest.approx(0.06)


def test_velocities_are_in_units_of_the_manual(servo):
    write(servo, "profile_velocity", 100)
    speed = servo.command().speed
    assert speed == pytest.approx(22.9 * 2 * math.pi / 60)
    update(servo, velocity=-speed, current=-0.12, voltage=4.8)
    assert read(servo, "present_velocity") == -100
    assert read(servo, "present_current") == -120
    assert read(servo, "present_voltage") == 48
    assert read(servo, "moving") == 1


def test_a_current_heats_the_servo_until_it_shuts_down(servo):
    write(servo, "torque_enable", 1)
    update(servo, seconds=60.0, current=1.2)
    warm = read(servo, "present_temperature")
    for _ in range(10):
        update(servo, seconds=60.0, current=1.29)
    assert 25 < warm < 70
    assert servo.errors == ("overheating",)
    assert not servo.torque


def test_a_blocked_motor_is_overloaded_after_a_second(servo):
    write(servo, "torque_enable", 1)
    for _ in range(99):
        update(servo, current=1.5)
    assert servo.torque
    for _ in range(3):
        update(servo, current=1.5)
    assert servo.errors == ("overload",)
    assert not servo.torque
    with pytest.raises(RefusalError, match="cannot be executed"):
        write(servo, "torque_enable", 1)
    servo.restart(0.0)
    write(servo, "torque_enable", 1)
    assert servo.torque


def test_a_wrong_voltage_is_an_error_that_lasts(servo):
    update(servo, voltage=3.0)
    update(servo, voltage=5.0)
    assert servo.errors == ("voltage",)


def test_errors_outside_the_shutdown_mask_leave_the_torque_on(servo):
    write(servo, "shutdown", 0)
    write(servo, "torque_enable", 1)
    servo.raise_error("overheating")
    assert servo.torque
    assert servo.errors == ("overheating",)
