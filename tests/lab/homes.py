"""Arms with servos in tests, and their calibrations."""

from datetime import UTC, datetime

from s2c2a.arm import load_arm, servos_of
from s2c2a.lab.emulation.xl330 import firmware_of
from s2c2a.lab.hardware.calibration import CalibratedServo, Calibration


def arm_with_servos(base="twin_arm", **table):
    """An arm with a table `[servos]`: by default, three cables a module, ids in order."""
    arm = load_arm(base)
    servos = {"ids": [[1, 2, 3], [4, 5, 6], [7, 8, 9]]} | table
    return type(arm).model_validate(arm.model_dump() | {"servos": servos})


def calibration_with(arm, homes):
    """A calibration of the servos of an arm, with their homes [ticks] by id."""
    servos = []
    for id, home in homes.items():
        table = servos_of(arm).of(id)
        is_feetech = table.protocol == "feetech"
        firmware = 310 if is_feetech else firmware_of(table.model_number, 52)
        servos.append(
            CalibratedServo(id=id, model=table.model, firmware=firmware, home=home)
        )
    date = datetime(2026, 1, 1, tzinfo=UTC)
    return Calibration(arm=arm.name, date=date, servos=tuple(servos))
