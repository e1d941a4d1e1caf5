"""Calibration of winches: the servo positions of the straight arm, in a file."""

import os
from datetime import datetime
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.files.json_files import load_json, save_json
from s2c2a.lab.hardware.winch import NO_SERVO, Ticks, servo_ids

FORMAT = 1
MAX_SERVOS = 160
MAKE_ONE = (
    "make one with `s2c2a motors home --arm FILE`, or name one (--calibration FILE in "
    "`motors check`, --robot-option calibration=FILE elsewhere)"
)
MAX_SPREAD = 0.001  # m; largest standard deviation of reliable homings


class CalibrationError(S2C2AError):
    """A calibration is missing, damaged, or that of another arm."""


class CalibratedServo(BaseModel):
    """One servo and its home.

    Attributes:
        id: on the bus.
        model: name of its model.
        firmware: version.
        home: position of the straight arm [ticks].
        spread: standard deviation of repeated homings [m]; None after a single one.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    id: int = Field(strict=True, ge=0, le=252)
    model: str = Field(max_length=40)
    firmware: int = Field(strict=True, ge=0, le=2**16 - 1)
    home: int = Field(strict=True, ge=-(2**31), le=2**31)
    spread: float | None = Field(default=None, ge=0)


class Calibration(BaseModel):
    """Homes of all servos of an arm.

    Attributes:
        arm: name of the arm.
        date: of the homing, ISO 8601.
        adapter: serial number of the adapter, if it has one.
        servos: module by module.
        finished: whether all servos have been homed; if not, homing can continue.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    format: int = Field(default=FORMAT, ge=FORMAT, le=FORMAT)
    arm: str = Field(max_length=64)
    date: datetime
    adapter: str = Field(default="", max_length=100)
    servos: tuple[CalibratedServo, ...] = Field(max_length=MAX_SERVOS)
    finished: bool = True

    @field_validator("servos")
    @classmethod
    def _check_ids(
        cls, servos: tuple[CalibratedServo, ...]
    ) -> tuple[CalibratedServo, ...]:
        if len({servo.id for servo in servos}) < len(servos):
            raise ValueError("a servo occurs twice; home the arm again")
        return servos

    @property
    def spread(self) -> float:
        """Largest standard deviation of repeated homings [m]; zero if unknown."""
        return max((servo.spread or 0.0 for servo in self.servos), default=0.0)

    def check_repeatability(self) -> None:
        """Check that repeated homings agree.

        Raises:
            CalibrationError: they differ by more than `MAX_SPREAD`.
        """
        if self.spread > MAX_SPREAD:
            raise CalibrationError(
                f"the homings differ by {1000 * self.spread:.1f} mm, too much for a "
                "calibration; let the arm stand straight without payload, check the "
                "cables, then home it again (`s2c2a motors home --overwrite`)"
            )

    def home(self, arm: ArmSpec) -> Ticks:
        """Return the homes of an arm's servos [ticks], shape (modules, cables).

        They are zero beyond the cables of a module.

        Raises:
            CalibrationError: servos of the arm are missing in the calibration, or its
                homings differ too much.
        """
        homes = {servo.id: servo.home for servo in self.servos}
        ids = servo_ids(arm)
        present = ids != NO_SERVO
        missing = sorted(set(ids[present].tolist()) - homes.keys())
        if missing or not self.finished:
            raise CalibrationError(
                f"the calibration of '{self.arm}' lacks servos {missing}; "
                "finish it with `s2c2a motors home --resume`"
            )
        self.check_repeatability()
        ticks = np.zeros(ids.shape, int)
        ticks[present] = [homes[id] for id in ids[present].tolist()]
        return ticks


def default_path(arm: ArmSpec) -> Path:
    """Return the name of the calibration file of an arm, in the current folder."""
    return Path(f"{arm.name}.calibration.json")


def save_calibration(calibration: Calibration, path: str | os.PathLike) -> None:
    """Write a calibration file; an interruption leaves the former file.

    Raises:
        CalibrationError: the file cannot be written.
    """
    save_json(calibration, path, CalibrationError)


def load_calibration(path: str | os.PathLike, arm: ArmSpec) -> Calibration:
    """Read the calibration file of an arm.

    Raises:
        CalibrationError: there is no such file, it is damaged, or it belongs to
            another arm.
    """
    calibration = load_json(
        Calibration, path, CalibrationError, "calibration", MAKE_ONE
    )
    if calibration.arm != arm.name:
        raise CalibrationError(
            f"{path} is the calibration of '{calibration.arm}', not of '{arm.name}'; "
            "name another file, or home this arm (`s2c2a motors home`)"
        )
    return calibration
