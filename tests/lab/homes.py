"""Calibrations of arms in tests."""

from datetime import UTC, datetime

from s2c2a.lab.hardware.calibration import CalibratedServo, Calibration


def calibration_with(arm, homes, model="xl330-m288", firmware=52):
    """A calibration of servos of one model, with their homes [ticks] by id."""
    servos = [
        CalibratedServo(id=id, model=model, firmware=firmware, home=home)
        for id, home in homes.items()
    ]
    date = datetime(2026, 1, 1, tzinfo=UTC)
    return Calibration(arm=arm.name, date=date, servos=tuple(servos))
