"""A real robot together with a pose tracker."""

import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.sensors import Camera
from s2c2a.lab.tracking.calibration import (
    TrackingCalibration,
    calibration_path,
    describe_tracking_calibration,
    load_or_empty,
    load_tracking_calibration,
)
from s2c2a.lab.tracking.clock import ExposureClock
from s2c2a.lab.tracking.frame_jumps import FrameJumps
from s2c2a.lab.tracking.frozen_bodies import FrozenBodies
from s2c2a.lab.tracking.plausibility import CheckedStates, StateCheck
from s2c2a.lab.tracking.poses import TrackingError
from s2c2a.lab.tracking.sources import tracker_of
from s2c2a.lab.tracking.states import await_poses
from s2c2a.lab.tracking.tracker import PoseFrame, Tracker
from s2c2a.measurements.frame_jumps import describe_frame_jump
from s2c2a.robots import Robot
from s2c2a.spaces import POSITION, Actions, Reading, Sensor, States

MAX_SILENCE = 1.5  # control periods since a frame arrived; then states are missing
CAMERA_TOLERANCE = 0.1  # of a camera's period
ALL = 0  # in place of the number of a module
FROZEN = "frozen"
REASONS = {
    "out of reach": "is out of reach",
    "jumped": "has jumped",
    FROZEN: "is frozen: its pose is repeated while its cables and other bodies move",
}


@dataclass(frozen=True, eq=False)
class _CheckedFrame:
    """A frame of the tracker, with what follows from it.

    Attributes:
        frame: of the tracker.
        exposure: time on the clock `time.perf_counter` [s].
        checked: states of the module ends that the arm can have.
        jump: of all ends at once [m]; None if there is none.
    """

    frame: PoseFrame
    exposure: float
    checked: CheckedStates
    jump: np.ndarray | None


class StateSensor:
    """States of the module ends from a tracker, as sensors of a robot.

    Attributes:
        sensors: their declarations.
    """

    def __init__(self, arm: ArmSpec, source: str, tracker: Tracker | None = None):
        """Prepare the tracker; nothing is received yet.

        Args:
            arm: its table `[tracking]` names the bodies and the calibration.
            source: of `tracker_of`.
            tracker: instead of that of the source.

        Raises:
            S2C2AError: there is no such source, or the calibration is damaged.
        """
        calibration = calibration_of(arm)
        self._source = source
        self._tracker = tracker or tracker_of(source)
        self._ends = calibration.ends(arm)
        self._clock = ExposureClock(calibration.latency or 0.0)
        self._newest: _CheckedFrame | None = None
        geometry = ArmGeometry.of(arm)
        self._check = StateCheck(geometry.lengths, geometry.bend_limits)
        self._frozen = FrozenBodies(self._ends, geometry)
        self._jumps = FrameJumps(arm.length)
        self._warned: set[tuple[int, str]] = set()
        self._max_silence = MAX_SILENCE * arm.control_period
        self._camera = arm.sensors.camera
        self._camera_views = _CameraViews(self._camera) if self._camera else None
        shape = (arm.module_count, 6)
        self._missing = np.full(shape, np.nan)
        self.sensors: dict[str, Sensor] = {
            "states": Sensor(shape, "m, 1", always=False),
            "states_age": Sensor((), "s", always=False),
        }
        if self._camera:
            self.sensors |= {
                "camera_positions": Sensor((arm.module_count, 3), "m", always=False),
                "camera_age": Sensor((), "s", always=False),
            }

    def start(self) -> None:
        """Begin to receive, and wait for plausible poses of all tracked module ends.

        Raises:
            TrackingError: they do not arrive; the arm does not move.
        """
        self._tracker.start()
        self._newest = None
        self._check.reset()
        self._frozen.reset()
        self._jumps.reset()
        self._warned.clear()
        advice = "correct it, or add --tracking none (docs/guides/tracking.md)"
        await_poses(self._find_problem, advice)

    def latest(self) -> PoseFrame | None:
        """Return the newest frame; None before the first."""
        return self._tracker.latest()

    def sent(self, command: Actions) -> None:
        """Note a command that the robot sent: its cables move the ends."""
        self._frozen.sent(command, time.perf_counter())

    def values(self, frame: PoseFrame | None, now: float) -> dict[str, np.ndarray]:
        """Return the sensors at a time of the clock `time.perf_counter` [s].

        States are NaN if no frame has arrived, or the newest one is too old. Rows that
        are impossible for the arm or frozen are NaN, too; a warning states each reason
        once. So does one of a jump of all ends at once, which removes no row.
        """
        if frame is None or now - frame.arrival_time > self._max_silence:
            return {"states": self._missing}
        newest = self._newest_of(frame)
        age = np.asarray(now - newest.exposure)
        states = newest.checked.states
        for module, reason in enumerate(newest.checked.reasons, 1):
            if reason:
                self._warn(
                    module, reason, f"{_describe(module, reason)}; it is missing"
                )
        if newest.jump is not None:
            self._warn(ALL, "jump", describe_frame_jump(newest.jump))
        values = {"states": states, "states_age": age}
        if self._camera_views is not None:
            values |= self._camera_views.read(frame, states, now, age)
        return values

    def close(self) -> None:
        """Stop receiving; allowed more than once."""
        self._tracker.close()

    def _find_problem(self) -> str:
        """Describe what the newest frame lacks; empty if it has all poses."""
        frame = self._tracker.latest()
        problem = self._ends.find_missing(self._tracker)
        if frame is not None and not problem:
            reasons = enumerate(self._newest_of(frame).checked.reasons, 1)
            problem = "; ".join(_describe(*reason) for reason in reasons if reason[1])
        return problem and f"tracking {self._source}: {problem}"

    def _newest_of(self, frame: PoseFrame) -> _CheckedFrame:
        """Check a frame once, however often it is read: a repetition proves nothing."""
        newest = self._newest
        if newest is None or not frame.is_same(newest.frame):
            arrival = frame.arrival_time
            exposure = self._clock.exposure(arrival, frame.source_time)
            states = self._ends.states(frame)
            jump = self._jumps.find(states, exposure)
            # states that the arm can have, of bodies that are not frozen
            is_frozen = self._frozen.find(frame)
            # a frozen row would contradict others, which are true
            states = np.where(is_frozen[:, None], np.nan, states)
            checked = self._check(states, frame.arrival_time)
            reasons = [
                FROZEN if frozen else reason
                for frozen, reason in zip(is_frozen, checked.reasons, strict=True)
            ]
            checked = CheckedStates(checked.states, tuple(reasons))
            newest = _CheckedFrame(frame, exposure, checked, jump)
            self._newest = newest
        return newest

    def _warn(self, module: int, reason: str, message: str) -> None:
        """Warn of each reason of a module once."""
        if (module, reason) not in self._warned:
            self._warned.add((module, reason))
            warnings.warn(message, stacklevel=1)


class _CameraViews:
    """Some of the frames, as the camera of the arm's table `[sensors.camera]`."""

    def __init__(self, camera: Camera):
        self._camera = camera
        self._last_arrival = -np.inf
        self._last_time = -np.inf

    def read(
        self, frame: PoseFrame, states: States, now: float, age: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Return positions and age if the frame is new and a picture is due."""
        due = self._last_time + (1.0 - CAMERA_TOLERANCE) / self._camera.rate
        if frame.arrival_time == self._last_arrival or now < due:
            return {}
        self._last_arrival = frame.arrival_time
        self._last_time = now
        positions = states[:, POSITION].copy()
        if self._camera.sees == "tip":
            positions[:-1] = np.nan
        return {"camera_positions": positions, "camera_age": age}


class TrackedRobot(Robot):
    """A real robot whose readings also have the tracked states of its module ends.

    The sensors `states` and `states_age` are for recordings and scores; with a table
    `[sensors.camera]` in the arm file, `camera_positions` and `camera_age` are slow
    feedback for the state estimator.

    Args:
        robot: without these sensors.
        source: of the poses (`lab.tracking.sources.FORMS`).
        tracker: instead of that of the source.

    Raises:
        S2C2AError: there is no such source, the robot measures states itself, or it
            is simulated.
    """

    own_time = False
    describe_calibration = staticmethod(describe_tracking_calibration)

    def __init__(self, robot: Robot, source: str, tracker: Tracker | None = None):
        self.arm = robot.arm
        self._robot = robot
        if robot.own_time:
            raise TrackingError(
                f"{type(robot).__name__} has its own time, and a tracker measures in "
                "real time; leave out --tracking"
            )
        self._tracked = StateSensor(robot.arm, source, tracker)
        common = self._tracked.sensors.keys() & robot.sensors.keys()
        if common:
            raise TrackingError(
                f"{type(robot).__name__} measures {', '.join(sorted(common))} itself; "
                "add --tracking none"
            )

    def last_calibration(self) -> datetime | None:
        """When the arm was homed or its tracking calibrated, the later of both."""
        path = calibration_path(self.arm)
        dates = [self._robot.last_calibration()]
        if path.exists():
            dates.append(load_tracking_calibration(path, self.arm).date)
        known = [date.astimezone(UTC) for date in dates if date is not None]
        return max(known, default=None)

    @property
    def sensors(self) -> Mapping[str, Sensor]:
        """Sensors of the robot and of the tracker."""
        return {**self._robot.sensors, **self._tracked.sensors}

    def open(self) -> Reading:
        """See `Robot`.

        Raises:
            TrackingError: no poses arrive; the arm does not move.
        """
        self._tracked.start()
        reading = self._robot.open()
        frame = self._tracked.latest()
        return _with(reading, self._tracked.values(frame, time.perf_counter()))

    def read(self) -> Reading:
        before = time.perf_counter()
        frame = self._tracked.latest()
        reading = self._robot.read()
        # servos are asked one by one
        middle = (before + time.perf_counter()) / 2
        return _with(reading, self._tracked.values(frame, middle))

    def send(self, action: Actions) -> Actions:
        sent = self._robot.send(action)
        self._tracked.sent(sent)
        return sent

    def halt(self) -> None:
        self._robot.halt()

    def close(self) -> None:
        try:
            self._tracked.close()
        finally:
            self._robot.close()


def _describe(module: int, reason: str) -> str:
    return f"the tracked end of module {module} {REASONS.get(reason, reason)}"


def _with(reading: Reading, values: Mapping[str, np.ndarray]) -> Reading:
    """The reading with more sensors."""
    return replace(reading, sensors={**reading.sensors, **values})


def calibration_of(arm: ArmSpec) -> TrackingCalibration:
    """Return the tracking calibration of an arm; an empty one if there is no file.

    Raises:
        TrackingCalibrationError: the file that the arm file names does not exist, or
            the file is damaged or of another arm.
    """
    path = calibration_path(arm)
    is_named = arm.tracking is not None and arm.tracking.calibration
    load = load_tracking_calibration if is_named else load_or_empty
    return load(path, arm)
