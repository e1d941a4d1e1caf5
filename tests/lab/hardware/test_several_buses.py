"""An arm whose winches hang on two ports, or are of two models on one."""

import numpy as np
import pytest
from arm_on_a_wire import ArmOnAWire
from homes import arm_with_servos

from s2c2a.arm import load_arm, save_arm, servos_of
from s2c2a.arm.files import arm_from_toml, arm_to_toml
from s2c2a.arm.servos import Servos
from s2c2a.errors import S2C2AError
from s2c2a.lab.cli import motors
from s2c2a.lab.emulation.lab import open_lab
from s2c2a.lab.emulation.motive import MotiveOptions
from s2c2a.lab.hardware.buses import open_bus
from s2c2a.lab.hardware.calibration import load_calibration

DISTAL = [7, 8, 9]
PROXIMAL = [1, 2, 3, 4, 5, 6]
LIMITS = {"current": 0.5, "speed": 0.05}


def arm_on(
    folder, port="port-2", model="xl430-w250", limits=None, proximal="xm430-w350"
):
    """An arm whose distal servos differ from the others."""
    group = {"ids": DISTAL, "model": model, "limits": limits or LIMITS}
    if port:
        group["port"] = str(folder / port)
    table = {
        "model": proximal,
        "port": str(folder / "port"),
        "limits": {"current": 0.6, "high_voltage": 12.0},
        "groups": [group],
    }
    arm = arm_from_toml(arm_to_toml(arm_with_servos(**table)))
    assert arm_from_toml(arm_to_toml(arm)) == arm
    return arm


@pytest.fixture(params=["port-2", ""], ids=["two-ports", "one-port"])
def wire(request, emulator, tmp_path):
    return ArmOnAWire(emulator, tmp_path, arm=arm_on(tmp_path, request.param))


@pytest.fixture
def two_ports(emulator, tmp_path):
    return ArmOnAWire(emulator, tmp_path, arm=arm_on(tmp_path))


def torques(wire):
    return {servo["id"]: servo["torque"] for servo in wire.emulator.status()["servos"]}


def test_limits_that_a_group_leaves_out_are_those_of_all(tmp_path):
    servos = arm_on(tmp_path).servos
    assert servos.of(1) is servos
    distal = servos.of(8)
    assert (distal.limits.current, distal.limits.high_voltage) == (0.5, 12.0)
    assert (distal.model, distal.home_current) == ("xl430-w250", servos.home_current)
    assert [ids for _, ids in servos.parts()] == [PROXIMAL, DISTAL]


@pytest.mark.parametrize(
    ("group", "fault"),
    [
        ({"ids": [4]}, r"names \[4\], not in servos.ids"),
        ({"ids": [1, 1]}, r"names \[1\]"),
        ({"ids": [1], "model": "mine"}, "'mine' is no known model"),
        ({"ids": [1], "home_current": 0.7}, "home_current 0.7 A is not below"),
        ({"ids": [1], "baud_rate": 57_600}, "a port has one speed"),
        ({"ids": [1], "limits": {"displacement": 0.01}}, "one for the whole arm"),
        ({"ids": []}, "ids"),
        ({"ids": [1], "watchdog": 0.1}, "watchdog"),
    ],
)
def test_faults_of_groups_are_named(group, fault):
    with pytest.raises(ValueError, match=fault):
        Servos.model_validate({"ids": [[1, 2, 3]], "groups": [group]})


@pytest.mark.slow
def test_the_arm_moves_and_every_bus_keeps_its_limits(wire):
    with wire.driven():
        records = wire.steps(12)
        limits = {servo.id: servo.command().current for servo in wire.emulator.servos}
    assert not any(record.fault for record in records)
    assert wire.largest_error(wire.records) < 0.003
    assert np.abs(records[-1].action).max(axis=-1).min() > 0.001
    assert max(limits[id] for id in PROXIMAL) <= 0.61
    assert max(limits[id] for id in DISTAL) <= 0.51
    actions = np.array([record.action[2] for record in records])
    assert np.abs(np.diff(actions, axis=0)).max() <= 2.0 * 0.05 / wire.arm.control_rate


def test_a_lost_port_stops_the_servos_of_both(two_ports):
    wire = two_ports
    with wire.driven():
        wire.steps(4)
        wire.emulator.inject("unplug 30 8")
        with pytest.raises(S2C2AError, match="port-2 is gone"):
            wire.steps(10)
        at_fault = np.array(wire.places())
        wire.emulator.sleep(1.0)
        states = wire.emulator.status()["servos"]
        assert all(servo["watchdog_tripped"] for servo in states)
        assert np.abs(np.array(wire.places()) - at_fault).max() < 0.002


def test_the_limits_of_a_group_are_faults_of_its_servos(two_ports):
    limits = LIMITS | {"low_voltage": 5.5}  # the emulated supply has 5 V
    two_ports.arm = arm_on(two_ports.port.parent, limits=limits)
    with pytest.raises(S2C2AError, match=r"servo 7 .* 5.0 V; allowed are 5.5 to 12"):
        two_ports.robot().open()


def test_a_halt_releases_both_also_with_a_lost_port(two_ports):
    robot = two_ports.robot()
    robot.open()
    assert all(torques(two_ports).values())
    two_ports.emulator.inject("unplug 30 8")
    with pytest.raises(S2C2AError, match="gone"):
        robot.halt()
    assert not any(torques(two_ports)[id] for id in PROXIMAL)
    two_ports.emulator.sleep(1.0)
    assert all(two_ports.servo(id)["watchdog_tripped"] for id in DISTAL)
    robot.close()


def test_servos_of_both_buses_are_released_at_the_end(wire):
    robot = wire.robot()
    robot.open()
    robot.close()
    assert not any(torques(wire).values())


def test_no_servo_keeps_torque_where_one_bus_fails_to_switch_on(two_ports):
    servos = servos_of(two_ports.arm)
    ids = PROXIMAL + DISTAL
    with open_bus(servos) as bus:
        for part, own in servos.parts():
            bus.prepare(own, part.limits.current, 1.0)
        two_ports.emulator.inject("gone 9")
        with pytest.raises(S2C2AError):
            bus.set_torque(ids, on=True)
    assert not any(torques(two_ports).values())


def test_a_silent_servo_of_the_other_port_is_named(two_ports):
    with two_ports.driven():
        two_ports.steps(2)
        two_ports.sees("gone 8", r"servo 8 \(module 3, cable 2\)", 5)


@pytest.mark.slow
def test_homing_check_scan_and_timing_use_both_ports(emulator, tmp_path, capsys):
    path = tmp_path / "arm.toml"
    save_arm(arm_on(tmp_path, model="xl330-m288", proximal="xl330-m288"), path)
    emulator.start(path, tmp_path / "port")
    homes = tmp_path / "homes.json"
    motors.home(str(path), "", homes, repeat=1, yes=True)
    motors.check(str(path), "", homes, yes=True)
    motors.timing(str(path), cycles=5, yes=True)
    motors.scan(str(path))
    text = capsys.readouterr().out
    assert text.count("Servos on") == 2
    assert all(f"module 3, cable {cable}" in text for cable in (1, 2, 3))
    assert load_calibration(homes, load_arm(path)).finished


def test_a_servo_is_set_up_on_the_port_of_its_id(two_ports, tmp_path):
    # a servo alone on the second port
    for winch in two_ports.emulator._emulator.winches:
        gone = 0.0 if winch.original_id == 9 else np.inf
        winch.servo.gone_until = gone
    path = str(two_ports.arm_file)
    save_arm(two_ports.arm, path, overwrite=True)
    motors.setup(8, path, yes=True)
    servo = two_ports.emulator._emulator.winches[8].servo
    assert servo.id == 8


def test_a_laboratory_has_a_port_for_each_of_the_arm_file(tmp_path):
    mocap = MotiveOptions(command_port=2510, data_port=2511)
    open_lab(arm_on(tmp_path), tmp_path / "lab", mocap)
    servos = load_arm(tmp_path / "lab" / "arm.toml").servos
    assert servos.of(1).port == str(tmp_path / "lab" / "port")
    assert servos.of(9).port == str(tmp_path / "lab" / "port-2")
