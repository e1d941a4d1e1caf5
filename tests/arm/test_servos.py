"""The table `[servos]` of arm files."""

import pytest

from s2c2a.arm.servos import MODEL_NUMBERS, Servos
from s2c2a.lab.hardware.dynamixel import tables as dynamixel
from s2c2a.lab.hardware.feetech import tables as feetech


def test_models_of_arm_files_are_those_of_the_drivers():
    assert {
        "dynamixel": {name: one.number for name, one in dynamixel.MODELS.items()},
        "feetech": {name: one.number for name, one in feetech.MODELS.items()},
    } == MODEL_NUMBERS


@pytest.mark.parametrize(
    ("protocol", "model"), [("dynamixel", "xl330-m288"), ("feetech", "sts3215")]
)
def test_each_protocol_has_a_default_model(protocol, model):
    table = servos(protocol=protocol)
    assert table.model == model
    assert Servos.model_validate(table.model_dump(mode="json")) == table


OWN = {"number": 1270, "max_current": 2.0, "torque_constant": 1.5}


def servos(**table):
    return Servos.model_validate({"ids": [[1, 2, 3]], **table})


def test_an_arm_file_describes_a_model_of_its_own():
    table = servos(model="mine", own_model={**OWN, "registers": {"torque": 512}})
    assert table.model_number == 1270
    assert Servos.model_validate(table.model_dump(mode="json")) == table
    assert "own_model" not in servos().model_dump()


@pytest.mark.parametrize(
    ("table", "fault"),
    [
        ({"model": "mine"}, r"xl430-w250.*\[servos\.own_model\]"),
        ({"own_model": OWN}, "another name"),
        ({"model": "mine", "protocol": "feetech", "own_model": OWN}, "another name"),
        ({"model": "mine", "own_model": {**OWN, "number": 0}}, "number"),
        ({"model": "mine", "own_model": {**OWN, "max_current": 2000}}, "max_current"),
        ({"model": "mine", "own_model": {"number": 1270}}, "max_current"),
        ({"model": "mine", "own_model": {**OWN, "registers": {"torq": 64}}}, "torq"),
        ({"model": "a", "own_model": {**OWN, "registers": {"torque": -1}}}, "torque"),
    ],
)
def test_faults_of_models_are_named(table, fault):
    with pytest.raises(ValueError, match=fault):
        servos(**table)
