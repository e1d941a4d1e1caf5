"""Faults of servos and wire, with emulated servos at the other end."""

import numpy as np
import pytest
from arm_on_a_wire import ArmOnAWire

from s2c2a.lab.emulation.xl330 import TORQUE_AT_START
from s2c2a.lab.hardware.bus import PortLostError
from s2c2a.lab.hardware.servo_robot import NO_WATCHDOG
from s2c2a.runtime import check_robot
from s2c2a.runtime.emergency import EMERGENCY_STOP, EmergencyStopError
from s2c2a.spaces import Stage

CYCLES = 3  # in which a fault is seen
FOURTH = r"servo 4 \(module 2, cable 1\)"


@pytest.fixture
def wire(emulator, tmp_path, monkeypatch):
    """The arm of a test; in the end, no limit was exceeded."""
    monkeypatch.setattr("s2c2a.lab.hardware.servo_robot.SETTLING_TIME", 0.1)
    wire = ArmOnAWire(emulator, tmp_path)
    yield wire
    wire.check_limits()


@pytest.fixture
def feetech_wire(emulator, tmp_path):
    wire = ArmOnAWire(emulator, tmp_path, "feetech")
    with pytest.warns(UserWarning, match=NO_WATCHDOG[:30]):
        yield wire
    wire.check_limits()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ("overload 4", rf"{FOURTH} has switched off: overloaded"),
        ("reboot 4", rf"{FOURTH} (does not answer|has restarted)"),
        ("gone 4", rf"{FOURTH} does not answer"),
        ("voltage 3.5", r"servo 1 .*3\.5 V; allowed"),
    ],
)
def test_a_servo_that_fails_leads_the_arm_to_rest(wire, fault, text):
    with wire.driven():
        wire.steps(6)
        wire.sees(fault, text, CYCLES)
        assert wire.led_to_rest()
    wire.check_records()


@pytest.mark.slow
def test_a_hot_servo_leads_the_arm_to_rest_before_it_switches_off(wire):
    with wire.driven():
        wire.steps(6)
        wire.sees("hot 4", r"servo 4 .* deg C; the limit is 65", 100)
        assert wire.servo(4)["errors"] == []
        assert wire.led_to_rest()
    wire.check_records()


def test_a_stalled_servo_is_seen_after_a_second_of_motion(wire):
    with wire.driven():
        wire.steps(6)
        # the arm holds before the servo is far enough from its goal to name itself
        cable = r"do not follow the commands: module 1, cable 1"
        wire.sees("stalled 1", rf"servo 1 .* does not follow|{cable}", 40)
        wire.steps_until(Stage.RELEASE)
    wire.check_records()


def test_a_snapped_cable_is_reported_and_the_arm_goes_on(wire):
    with wire.driven(is_steady=True):
        wire.steps(15)
        wire.emulator.inject(f"snapped {wire.wound_in()}")
        with pytest.warns(UserWarning, match="may have snapped"):
            wire.steps(40)
    wire.check_records()


@pytest.mark.parametrize(
    ("kind", "fault"),
    [
        ("wire", "lost 0.08"),
        ("wire", "corrupted 0.08"),
        ("wire", "garbage 0.3"),
        ("wire", "late 0.015 0.08"),
        ("feetech_wire", "lost 0.05"),
    ],
)
def test_an_arm_goes_on_over_a_noisy_line(request, kind, fault):
    wire = request.getfixturevalue(kind)
    with wire.driven():
        wire.steps(4)
        wire.emulator.inject(fault)
        records = wire.steps(14)
        wire.emulator.inject(f"{fault[: fault.rindex(' ')]} 0")
    assert wire.loop.phase.stage is not Stage.FAULT
    assert sum(not record.fault for record in records) >= 7
    assert wire.largest_error(records) < 0.006
    wire.check_records()


def test_a_position_that_needs_stuffing_is_read_and_sent(wire):
    wire.emulator.inject("stuffed 4")
    with wire.driven():
        records = wire.steps(15)
    assert not any(record.fault for record in records)
    assert wire.largest_error(records) < 0.006


@pytest.mark.parametrize("fast_read", [False, True])
def test_an_absent_servo_costs_the_others_a_cycle_at_most(wire, fast_read):
    with wire.driven(fast_read=fast_read):
        wire.steps(6)
        wire.emulator.inject("gone 2 0.25")
        records = wire.steps(10)
    missing = [np.isnan(record.reading["cables"]) for record in records]
    silent = [places for places in missing if places.any()]
    assert 1 <= len(silent) <= 5
    assert sum(places.sum() > 1 for places in silent) <= 1
    assert records[-1].stage is Stage.RUN
    wire.check_records()


@pytest.mark.parametrize("startup", [0, TORQUE_AT_START])
def test_a_servo_that_restarted_moves_only_after_the_robot_was_opened_again(
    wire, startup
):
    servo = wire.emulator.servos[3]
    servo._turns_lost -= 1  # it counts from another turn, and will forget that
    with wire.driven() as loop:
        wire.steps(6)
        servo["startup"] = startup
        wire.sees("reboot 4", "servo 4", CYCLES)
        assert wire.led_to_rest()
        servo["startup"] = 0
        assert "has restarted" in loop.fault
        assert not wire.servo(4)["torque"]
        wire.steps(2)
        loop.open()
        wire.records.clear()
        records = wire.steps(8)
        assert wire.servo(4)["torque"]
    assert not any(record.fault for record in records[2:])
    assert wire.largest_error(records) < 0.006


def test_an_unplugged_port_ends_the_run_and_can_be_opened_again(wire):
    with wire.driven():
        wire.steps(6)
        wire.emulator.inject("unplug 0.7")
        with pytest.raises(PortLostError, match=r"gone .* open the arm again"):
            wire.steps(CYCLES)
    wire.check_records()
    wire.wait_until(has_stopped)
    wire.wait_until(lambda status: status["plugged"])
    wire.records.clear()
    with wire.driven():
        records = wire.steps(5)
    assert not any(record.fault for record in records)


def test_an_emergency_stop_releases_the_arm_where_it_is(wire):
    with wire.driven(is_steady=True):
        wire.steps(8)
        EMERGENCY_STOP.trigger("the test")
        with pytest.raises(EmergencyStopError, match="by the test"):
            wire.steps(1)
        EMERGENCY_STOP.reset()
        status = wire.emulator.status()
    assert not any(servo["torque"] for servo in status["servos"])
    wire.check_records()


def test_a_controller_that_stops_or_dies_leaves_servos_that_stop(wire):
    with wire.driven(is_steady=True):
        wire.steps(20)
        assert max(map(abs, wire.places())) > 0.003
        wire.wait_until(has_stopped)
        wire.steps(5)
        assert not any(servo.watchdog_tripped for servo in wire.emulator.servos)
        wire.wait_until(has_stopped)
        places = wire.places()
        wire.emulator.sleep(0.3)
        np.testing.assert_allclose(wire.places(), places, atol=3e-4)
    with wire.driven():
        assert not any(record.fault for record in wire.steps(3))


def has_stopped(status):
    """Whether all servos have stopped by their watchdog."""
    return all(servo["watchdog_tripped"] for servo in status["servos"])


def test_a_feetech_servo_that_restarted_gets_no_goal(feetech_wire):
    wire = feetech_wire
    with wire.driven():
        wire.steps(6)
        wire.sees("reboot 4", "servo 4", CYCLES)
        wire.steps_until(Stage.FAULT)
        assert "has restarted" in wire.loop.fault
        assert not wire.servo(4)["torque"]
    wire.check_records()


def test_the_robot_fulfills_the_contract_of_robots(wire):
    assert len(check_robot(wire.robot())) >= 5
