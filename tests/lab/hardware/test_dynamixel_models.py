"""DYNAMIXEL models beside the XL330, without current sensing, and of arm files."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from servos_in_memory import IDS, START, Clock, ServosInMemory, arm_file, serve

from s2c2a.arm import load_arm, servos_of
from s2c2a.arm.servos import MODEL_NUMBERS, OwnRegisters
from s2c2a.errors import S2C2AError
from s2c2a.lab.cli import motors
from s2c2a.lab.emulation.emulator import Emulator, EmulatorOptions
from s2c2a.lab.emulation.servo import MotorState
from s2c2a.lab.emulation.xl330 import firmware_of
from s2c2a.lab.hardware.bus import BusError, WrongModelError
from s2c2a.lab.hardware.buses import open_bus
from s2c2a.lab.hardware.dynamixel import tables

WITHOUT_CURRENT = ("xl430-w250", "mx-28")
OWN = {"number": 1270, "max_current": 2.0, "torque_constant": 1.5}


@pytest.fixture
def bench(tmp_path, monkeypatch):
    """Emulated servos of a model, and the arm file that names it."""

    def build(model, number, **table):
        port = ServosInMemory(Clock())
        firmware = firmware_of(number, 52)
        port.servos = [
            port.protocol.make_servo(id, MotorState(ticks=START), firmware)
            for id in IDS
        ]
        for servo in port.servos:
            servo["model_number"] = number
        serve(port, monkeypatch)
        monkeypatch.setattr("s2c2a.lab.hardware.bring_up.CURRENT_STEPS", (1.0,))
        return port, arm_file(tmp_path, model=model, **table)

    return build


def opened(arm):
    bus = open_bus(servos_of(load_arm(arm)), "fake")
    bus.accept_stored = lambda changes: True
    return bus


@pytest.mark.parametrize("model", list(tables.MODELS))
def test_servos_of_every_model_are_prepared_and_read(bench, model):
    port, arm = bench(model, MODEL_NUMBERS["dynamixel"][model])
    with opened(arm) as bus:
        bus.prepare([1, 2], 0.5, 5.0)
        states = bus.read_states([1, 2])
        assert bus.has_current == (model not in WITHOUT_CURRENT)
        assert bus.info(1).model == model
    missing = [math.isnan(states[id].current) for id in (1, 2)]
    assert missing == 2 * [not bus.has_current]
    assert port[1]["operating_mode"] == (5 if bus.has_current else 4)


def test_an_impossible_goal_is_refused_and_no_servo_gets_one(bench):
    port, arm = bench("xl330-m288", MODEL_NUMBERS["dynamixel"]["xl330-m288"])
    with opened(arm) as bus:
        bus.prepare([1, 2], 0.5, 5.0)
        before = [servo["goal_position"] for servo in port.servos]
        with pytest.raises(BusError, match=r"2: 1048576.*1048575"):
            bus.send_goals({1: START + 10, 2: 1_048_576})
        assert [servo["goal_position"] for servo in port.servos] == before


@pytest.mark.parametrize("model", WITHOUT_CURRENT)
def test_the_pwm_limits_servos_that_measure_no_current(bench, model):
    port, arm = bench(model, MODEL_NUMBERS["dynamixel"][model])
    with opened(arm) as bus:
        bus.prepare([1], 0.35, 5.0)
    # a quarter of the 1.4 A at stall
    assert port[1]["goal_pwm"] == pytest.approx(885 / 4, abs=1)
    assert port[1]["pwm_limit"] == pytest.approx(0.6 / 1.4 * 885, abs=1)
    assert port[1].command().current == pytest.approx(1.47 / 4, rel=0.01)


def test_an_arm_of_servos_without_current_is_homed_and_checked(bench, capsys):
    port, arm = bench("xl430-w250", 1060)
    homes = Path(arm).with_name("homes.json")
    port.taut = START - 400
    motors.home(arm, "fake", homes, repeat=1, yes=True)
    port.taut = -1e9
    motors.check(arm, "fake", homes, True)
    assert "tension not measured" in capsys.readouterr().out


def test_emulated_servos_in_use_store_the_mode_of_their_model(bench):
    _, arm = bench("xl430-w250", 1060)
    emulator = Emulator(load_arm(arm), EmulatorOptions(homed=True))
    assert {servo["operating_mode"] for servo in emulator.servos} == {4}


def test_a_model_of_the_arm_file_has_its_own_number_and_addresses(bench):
    registers = {"goal_current": 550, "indirect_data": 634}
    own = {**OWN, "current_unit": 0.00269, "registers": registers}
    _, arm = bench("xw430-t333", 1270, own_model=own)
    with opened(arm) as bus:
        assert bus.info(1).model == "xw430-t333"
        goal_current = replace(tables.REGISTERS["goal_current"], address=550)
        assert bus.registers["goal_current"] == goal_current
        assert bus.registers["position"] == tables.REGISTERS["position"]
        assert bus.model.indirect_data_of(52) == 634
        assert bus.torque_constant == 1.5


def test_a_model_of_the_arm_file_without_a_unit_measures_no_current(bench):
    _, arm = bench("xw430-t333", 1270, own_model=OWN)
    with opened(arm) as bus:
        assert not bus.has_current
        assert bus.model.max_current == pytest.approx(885 * bus.model.current_unit)
        assert bus.limit_register == "goal_pwm"


def test_unknown_servos_are_refused_with_the_list_and_the_way_out(bench):
    _, arm = bench("xl330-m288", 1090)
    with opened(arm) as bus, pytest.raises(WrongModelError) as caught:
        bus.prepare([1], 0.5, 5.0)
    assert "number 1090" in str(caught.value)
    assert "xl430-w250 (1060)" in str(caught.value)
    assert "[servos.own_model]" in str(caught.value)


def test_registers_of_arm_files_are_those_of_the_driver():
    own = set(OwnRegisters.model_fields) - {"indirect_data"}
    everywhere = {"model_number", "firmware", "id", "baud_rate", "return_delay"}
    everywhere |= {"secondary_id", "startup_configuration"}
    assert own | everywhere == set(tables.REGISTERS)


def test_the_emulator_refuses_addresses_that_it_does_not_have(bench):
    own = {**OWN, "registers": {"torque": 512}}
    _, arm = bench("mine", 1270, own_model=own)
    with pytest.raises(S2C2AError, match=r"own_model\.registers"):
        Emulator(load_arm(arm), EmulatorOptions())
