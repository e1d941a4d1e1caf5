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
    table = {"protocol": protocol, "ids": [[1, 2, 3]]}
    servos = Servos.model_validate(table)
    assert servos.model == model
    assert Servos.model_validate(servos.model_dump(mode="json")) == servos
