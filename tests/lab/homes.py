"""Calibrations of arms in tests."""

from datetime import UTC, datetime

from s2c2a.arm import servos_of
from s2c2a.lab.emulation.xl330 import firmware_of
from s2c2a.lab.hardware.calibration import CalibratedServo, Calibration


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
