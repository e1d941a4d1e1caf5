"""Rig: placement of cameras and motors relative to an arm.

An import identifies the rig and stores it in its recording; another take of the same
arm is converted with the same rig.
"""

from typing import Annotated

import numpy as np
from jaxtyping import Float
from pydantic import Field, ValidationError, model_validator

from s2c2a.arm import ArmSpec
from s2c2a.data import Recording
from s2c2a.logs.errors import LogError
from s2c2a.logs.log_map import MAX_CABLES, Column, LogMap, MapTable, Vector
from s2c2a.logs.tables import list_names
from s2c2a.logs.take import Drives, drive_scale

KEY = "rig"
DriveIndex = Annotated[int, Field(ge=0, lt=MAX_CABLES)]


class Rig(MapTable):
    """Placement of cameras and motors.

    Attributes:
        names: columns of the drives.
        scales: meters, newtons or pascals per unit of these columns.
        rests: values at rest that the map does not state, in these units; empty: zero.
        drive: index of the drive on each cable, by module and cable.
        factor: displacement [m], positive where the cable lengthens, or tension [N],
            per scaled unit of the drive, by module and cable.
        base: position of the base [m], frame of the log.
        axes: x, y, and z of the base frame, frame of the log.
    """

    names: tuple[Column, ...] = Field(max_length=MAX_CABLES)
    scales: tuple[float, ...] = Field(max_length=MAX_CABLES)
    rests: tuple[float, ...] = Field(default=(), max_length=MAX_CABLES)
    drive: tuple[tuple[DriveIndex, ...], ...] = Field(max_length=MAX_CABLES)
    factor: tuple[tuple[float, ...], ...] = Field(max_length=MAX_CABLES)
    base: Vector
    axes: tuple[Vector, Vector, Vector]

    @model_validator(mode="after")
    def _check_consistency(self):
        drive_counts = [len(row) for row in self.drive]
        factor_counts = [len(row) for row in self.factor]
        counts = {len(self.scales), len(self.rests) or len(self.names)}
        if drive_counts != factor_counts or counts != {len(self.names)}:
            raise ValueError("the numbers of cables or drives disagree")
        if any(drive >= len(self.names) for row in self.drive for drive in row):
            raise ValueError(f"a cable names a drive beyond the {len(self.names)}")
        axes = np.array(self.axes)
        if not np.allclose(axes @ axes.T, np.eye(3), atol=1e-3):
            raise ValueError("the axes are not orthonormal")
        return self

    @classmethod
    def identified(
        cls,
        log_map: LogMap,
        rests: np.ndarray,
        drive: np.ndarray,
        factor: np.ndarray,
        base: np.ndarray,
        axes: np.ndarray,
    ) -> "Rig":
        """Rig that an import has identified, for the drives of a map."""
        return cls.model_validate(
            {
                "names": [drive.name for drive in log_map.drives],
                "scales": _scales(log_map),
                "rests": rests.tolist(),
                "drive": drive.tolist(),
                "factor": factor.tolist(),
                "base": base.tolist(),
                "axes": axes.tolist(),
            }
        )

    @classmethod
    def of(cls, recording: Recording, log_map: LogMap) -> "Rig":
        """Rig of an imported recording, for another log of the same arm.

        Raises:
            LogError: the recording has no rig, or the map describes another arm or
                other drives.
        """
        arm = recording.arm
        advice = "import its logs again, without --like"
        try:
            rig = cls.model_validate(recording.options.get(KEY))
        except ValidationError as error:
            raise LogError(
                f"the recording has no valid rig of cameras and motors; {advice}"
            ) from error
        check_arm(arm, log_map)
        names = [drive.name for drive in log_map.drives]
        _check_equal("the drives", list_names(names), list_names(rig.names))
        for name, new, old in zip(names, _scales(log_map), rig.scales, strict=True):
            _check_equal(f"meters or newtons per unit of '{name}'", new, old)
        if np.shape(rig.drive) != (arm.module_count, arm.cable_count):
            raise LogError(
                f"the rig of the recording does not fit '{arm.name}'; {advice}"
            )
        return rig

    def cables(self, columns: Drives) -> Float[np.ndarray, "rows modules cables"]:
        """Displacements [m] or tensions [N] of the cables, from the drives' columns."""
        return columns[:, np.array(self.drive)] * np.array(self.factor)

    def in_base(
        self, states: Float[np.ndarray, "rows modules 6"]
    ) -> Float[np.ndarray, "rows modules 6"]:
        """States in the base frame, from those in the frame of the log."""
        return transform_states(states, np.array(self.base), np.array(self.axes))


def transform_states(
    states: Float[np.ndarray, "*batch 6"],
    base: Float[np.ndarray, "3"],
    axes: Float[np.ndarray, "3 3"],
) -> Float[np.ndarray, "*batch 6"]:
    """States in the frame with this origin and these axes as rows."""
    positions = (states[..., :3] - base) @ axes.T
    return np.concatenate([positions, states[..., 3:] @ axes.T], axis=-1)


def check_arm(arm: ArmSpec, log_map: LogMap) -> None:
    """Refuse an arm that differs from the one in a map.

    Raises:
        LogError: the number of modules, the control rate, or the actuation differs.
    """
    _check_equal("modules", log_map.arm.modules, arm.module_count)
    rate = float(log_map.arm.control_rate)
    _check_equal("control_rate", rate, float(arm.control_rate))
    _check_equal("actuation", log_map.actuation, arm.actuation)


def _check_equal(name: str, in_map: object, in_arm: object) -> None:
    if in_map != in_arm:
        raise LogError(
            f"{name}: {in_map} in the map, {in_arm} in the arm or recording; "
            "correct one of them"
        )


def _scales(log_map: LogMap) -> tuple[float, ...]:
    return tuple(float(drive_scale(drive, log_map)) for drive in log_map.drives)
