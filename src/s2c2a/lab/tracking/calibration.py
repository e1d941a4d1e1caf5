"""Calibration of a tracker for one arm: latency and frame offsets, in a file."""

import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AwareDatetime, Field

from s2c2a.arm import ArmSpec
from s2c2a.files.json_files import load_json, save_json
from s2c2a.lab.tracking.frames import HeldPoses
from s2c2a.lab.tracking.poses import Pose, StoredRotation, StoredTable, TrackingError
from s2c2a.lab.tracking.states import ModuleEnds

FORMAT = 1
MAX_BODIES = 64
MAX_LATENCY = 1.0  # s
MAKE_ONE = "make one with `s2c2a tracking frames` and `s2c2a tracking latency`"
BodyName = Annotated[str, Field(min_length=1, max_length=64)]


class TrackingCalibrationError(TrackingError):
    """A calibration of a tracker is missing, damaged, or that of another arm."""


class StoredPose(StoredTable):
    """A pose `T_a_b` in a file.

    Attributes:
        position: of the origin of b [m], frame a.
        rotation: unit quaternion (x, y, z, w) from b to a.
    """

    position: tuple[float, float, float]
    rotation: StoredRotation

    @classmethod
    def of(cls, pose: Pose) -> Self:
        """Return a pose as a file stores it."""
        return cls(position=pose.position.tolist(), rotation=pose.rotation.tolist())

    @property
    def pose(self) -> Pose:
        """The pose."""
        return Pose(np.array(self.position), np.array(self.rotation))


class StoredHeldPoses(StoredTable):
    """Poses in one held configuration of an unfinished calibration.

    Attributes:
        bends: of the encoders [rad].
        base: `T_world_base`.
        ends: `T_world_end` of every module end, from the base.
    """

    bends: tuple[tuple[float, float], ...] = Field(max_length=MAX_BODIES)
    base: StoredPose
    ends: tuple[StoredPose, ...] = Field(max_length=MAX_BODIES)

    @classmethod
    def of(cls, held: HeldPoses) -> Self:
        """Return poses as a file stores them."""
        return cls(
            bends=held.bends.tolist(),
            base=StoredPose.of(held.base),
            ends=tuple(map(StoredPose.of, held.ends)),
        )

    @property
    def held(self) -> HeldPoses:
        """The poses."""
        ends = tuple(end.pose for end in self.ends)
        return HeldPoses(np.array(self.bends), self.base.pose, ends)


class UnfinishedFrames(StoredTable):
    """Poses of frames that are not all held yet.

    Attributes:
        setup: digest of what they were held with.
        date: of the last one.
        held: poses, bend by bend.
    """

    setup: str = Field(max_length=64)
    date: AwareDatetime
    held: tuple[StoredHeldPoses, ...] = Field(max_length=8 * MAX_BODIES + 2)


class FrameResidual(StoredTable):
    """What the fit of the frames leaves unexplained at one module's end.

    Attributes:
        position: root mean square over the configurations [m].
        rotation: root mean square over the configurations [rad].
    """

    position: float = Field(ge=0)
    rotation: float = Field(ge=0)


class TrackingCalibration(StoredTable):
    """Latency and frame offsets of a tracker; parts that were not found are None.

    Attributes:
        arm: name of the arm.
        date: of the last change.
        latency: from exposure to arrival of a frame, relative to servo readings [s].
        latency_std: standard deviation of the latency [s].
        base_offset: `T_base_arm`, of the arm's base frame in the base body.
        end_offsets: `T_end_module` by body, of the module's end frame in the body.
        residuals: of the frame offsets, by body.
        unfinished: frames that are not all held yet.
    """

    format: int = Field(default=FORMAT, ge=FORMAT, le=FORMAT)
    arm: str = Field(max_length=64)
    date: AwareDatetime
    # the clocks of servo readings and frames agree within some milliseconds only
    latency: float | None = Field(default=None, ge=-MAX_LATENCY, le=MAX_LATENCY)
    latency_std: float | None = Field(default=None, ge=0, le=MAX_LATENCY)
    base_offset: StoredPose | None = None
    end_offsets: dict[BodyName, StoredPose] | None = Field(
        default=None, max_length=MAX_BODIES
    )
    residuals: dict[BodyName, FrameResidual] | None = Field(
        default=None, max_length=MAX_BODIES
    )
    unfinished: UnfinishedFrames | None = None

    @classmethod
    def empty(cls, arm: ArmSpec) -> Self:
        """Return the calibration of an arm of which nothing is known."""
        return cls(arm=arm.name, date=datetime.now(UTC))

    def with_latency(self, latency: float, std: float) -> Self:
        """Return the calibration with another latency [s] and deviation [s]."""
        return self._changed({"latency": latency, "latency_std": std})

    def with_frames(
        self,
        base_offset: Pose,
        end_offsets: Mapping[str, Pose],
        residuals: Mapping[str, FrameResidual],
    ) -> Self:
        """Return the calibration with other frame offsets."""
        ends = {name: StoredPose.of(pose) for name, pose in end_offsets.items()}
        return self._changed(
            {
                "base_offset": StoredPose.of(base_offset),
                "end_offsets": ends,
                "residuals": dict(residuals),
            }
        )

    def with_unfinished(self, setup: str, held: Sequence[HeldPoses]) -> Self:
        """Return the calibration with the poses of unfinished frames, if any."""
        poses = tuple(map(StoredHeldPoses.of, held))
        frames = UnfinishedFrames(setup=setup, date=datetime.now(UTC), held=poses)
        # what runs use is as old as before
        return self._changed(
            {"unfinished": frames if held else None, "date": self.date}
        )

    def _changed(self, values: dict[str, Any]) -> Self:
        fields = {name: getattr(self, name) for name in type(self).model_fields}
        return type(self).model_validate(fields | {"date": datetime.now(UTC)} | values)

    def ends(self, arm: ArmSpec) -> ModuleEnds:
        """Return the assignment of bodies with these offsets; identities if unknown.

        Args:
            arm: names the bodies.

        Raises:
            TrackingError: an offset is of a body that is no module end.
        """
        offsets: dict[str, Any] = {}
        if self.base_offset is not None:
            offsets["base_offset"] = self.base_offset.pose
        if self.end_offsets is not None:
            stored = self.end_offsets.items()
            offsets["end_offsets"] = {name: pose.pose for name, pose in stored}
        return ModuleEnds.of_arm(arm, **offsets)


def calibration_path(arm: ArmSpec) -> Path:
    """Return the file that the arm file names, or NAME.tracking.json.

    A relative path begins in the current folder.
    """
    named = arm.tracking.calibration if arm.tracking is not None else ""
    return Path(named or f"{arm.name}.tracking.json")


def describe_tracking_calibration(arm: ArmSpec) -> str:
    """Describe which calibration a tracker of the arm uses, and what it contains.

    Raises:
        TrackingCalibrationError: the file is damaged or of another arm.
    """
    path = calibration_path(arm)
    if not path.exists():
        return f"none ({path} does not exist; {MAKE_ONE})"
    calibration = load_tracking_calibration(path, arm)
    latency = "no latency"
    if calibration.latency is not None:
        latency = f"latency {1000 * calibration.latency:.0f} ms"
    frames = "no frames"
    if calibration.end_offsets is not None:
        frames = f"frames of {', '.join(calibration.end_offsets)}"
    return f"{path} of {calibration.date:%Y-%m-%d %H:%M}: {latency}, {frames}"


def save_tracking_calibration(
    calibration: TrackingCalibration, path: str | os.PathLike
) -> None:
    """Write a calibration file; an interruption leaves the former file.

    Raises:
        TrackingCalibrationError: the file cannot be written.
    """
    save_json(calibration, path, TrackingCalibrationError)


def load_tracking_calibration(
    path: str | os.PathLike, arm: ArmSpec
) -> TrackingCalibration:
    """Read the calibration file of an arm.

    Raises:
        TrackingCalibrationError: there is no such file, it is damaged, or it belongs
            to another arm.
        TrackingError: it has an offset of a body that is no module end.
    """
    calibration = load_json(
        TrackingCalibration,
        path,
        TrackingCalibrationError,
        "tracking calibration",
        MAKE_ONE,
    )
    if calibration.arm != arm.name:
        raise TrackingCalibrationError(
            f"{path} is the tracking calibration of '{calibration.arm}', not of "
            f"'{arm.name}'; name another file, or calibrate the tracker of this arm"
        )
    # check that the offsets are of bodies that the arm file names
    try:
        calibration.ends(arm)
    except TrackingError as error:
        raise TrackingCalibrationError(
            f"{path} does not fit the bodies of the arm file: {error}; correct "
            "tracking.ends, or calibrate again (`s2c2a tracking frames`)"
        ) from error
    return calibration


def load_or_empty(path: str | os.PathLike, arm: ArmSpec) -> TrackingCalibration:
    """Read the calibration file of an arm, or begin one that does not exist.

    Raises:
        TrackingCalibrationError: the file is damaged, or belongs to another arm.
    """
    if Path(path).exists():
        return load_tracking_calibration(path, arm)
    return TrackingCalibration.empty(arm)
