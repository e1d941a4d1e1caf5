"""Motions of an arm that calibrate its tracker: latency and frames.

Every command passes the limits of the control loop. They count control steps; here
commands are sent more often, with the same largest speed and acceleration.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.emergency import EMERGENCY_STOP, EmergencyStopError
from s2c2a.errors import RobotError
from s2c2a.lab.tracking import ModuleEnds, Pose, PoseFrame, Tracker, TrackingError
from s2c2a.lab.tracking.calibration import (
    FrameResidual,
    TrackingCalibration,
    calibration_path,
    load_or_empty,
    save_tracking_calibration,
)
from s2c2a.lab.tracking.clock import ExposureClock
from s2c2a.lab.tracking.frames import Frames, HeldPoses, find_frames, mean_pose
from s2c2a.lab.tracking.latency import Latency, MotionRecord, bends_of, find_latency
from s2c2a.robots import Robot
from s2c2a.runtime import Clock, CommandLimits, StepClock, WallClock
from s2c2a.runtime.limits import CommandLimiter
from s2c2a.standstill import StandstillCheck

COMMAND_RATE = 50.0  # Hz
FAULT_PATIENCE = 0.5  # s, for which the arm is held after readings with a fault
POLL_PERIOD = 0.002  # s
FIRST_POSES = 5.0  # s in which the first poses must come
CHIRP_DURATION = 40.0  # s
CHIRP_FREQUENCIES = (0.15, 2.5)  # Hz
CHIRP_BEND_DEG = 12.0
LIMIT_SHARE = 0.7  # of speed and acceleration limits, so that no command is shortened
RAMP = 1.0  # s
HELD_BEND_DEG = 15.0
OVERSHOOT = 1.3
SETTLING_TIME = 2.0  # s; vibration decays
AVERAGING_TIME = 1.0  # s
MIN_HELD_FRAMES = 10
MAX_APPROACH = 60.0  # s; from full bend to full bend takes 7 s at 0.5 deg a step
Progress = Callable[[int, int], None]


@dataclass
class MotionLog:
    """Readings and frames of a motion, on the clock `time.perf_counter`.

    Attributes:
        times: of the readings [s].
        cables: of the readings [m or N].
        frames: new frames.
    """

    times: list[float] = field(default_factory=list)
    cables: list[np.ndarray] = field(default_factory=list)
    frames: list[PoseFrame] = field(default_factory=list)


class TrackedMotion:
    """Moves an open robot within the limits, and logs readings and frames.

    Attributes:
        arm: arm of the robot.
        log: of all steps since it was replaced.
    """

    def __init__(self, robot: Robot, tracker: Tracker, clock: Clock | None = None):
        """A motion that begins at rest.

        Args:
            robot: open.
            tracker: started; its arrival times are on the same clock.
            clock: by default the wall clock, or a `StepClock` for a simulation.
        """
        self.arm = robot.arm
        self.log = MotionLog()
        self._robot = robot
        self._tracker = tracker
        self._clock = clock or (StepClock() if robot.own_time else WallClock())
        self._period = 1.0 / COMMAND_RATE
        self._limiter = CommandLimiter(limits_at(robot.arm, COMMAND_RATE))
        self._geometry = ArmGeometry.of(robot.arm)
        self._due = self._clock.now()
        self._sound_time = self._due
        self._gap = StandstillCheck(self._clock.with_sleep)
        self._last: PoseFrame | None = None

    def step(self, bends: Float[np.ndarray, "modules 2"]) -> None:
        """Read, send the command for bends [rad] within the limits, and wait.

        Raises:
            EmergencyStopError: the emergency stop was triggered; the arm is halted.
            RobotError: readings have had a fault for longer than `FAULT_PATIENCE`.
        """
        shares = bends / self._geometry.action_bends[:, None]
        self._send(self._geometry.actions_at(shares))

    def hold(self, bends: Float[np.ndarray, "modules 2"], seconds: float) -> None:
        """Approach bends [rad] within the limits, then hold them for a time.

        Raises:
            RobotError: the cables do not reach these bends, or not in `MAX_APPROACH`;
                see also `step`.
        """
        shares = bends / self._geometry.action_bends[:, None]
        target = self._geometry.actions_at(shares)
        self._check_reach(target, bends)
        end = self._end_of_approach()
        while self._limiter.changed(target):
            self._check_time(end)
            self._send(target)
        for _ in range(round(seconds * COMMAND_RATE)):
            self._send(target)

    def rest(self) -> None:
        """Return to rest.

        Raises:
            RobotError: it is not at rest after `MAX_APPROACH`; see also `step`.
        """
        end = self._end_of_approach()
        while not self._limiter.at_rest:
            self._check_time(end)
            self._send(self._limiter.towards_rest())

    def _check_reach(
        self, target: np.ndarray, bends: Float[np.ndarray, "modules 2"]
    ) -> None:
        """Raise an error for a target out of the actions' range: it is never reached."""
        geometry = self._geometry
        tolerance = 1e-6 * np.abs(geometry.action_scale)[:, None]
        is_low = target < geometry.action_low - tolerance
        is_high = target > geometry.action_high + tolerance
        modules = np.flatnonzero((is_low | is_high).any(axis=-1))
        if modules.size:
            module = int(modules[0])
            wanted = np.rad2deg(np.linalg.norm(bends[module]))
            limit = np.rad2deg(geometry.action_bends[module])
            raise RobotError(
                f"module {module + 1} shall bend by {wanted:.0f} deg, but the range of "
                f"its cables ends at {limit:.0f} deg; correct cable.travel or "
                "bend_limit_deg in the arm file"
            )

    def _end_of_approach(self) -> float:
        # an arm with slow limits may take longer
        bend = 4.0 * float(self._geometry.action_bends.max())
        speed = self._geometry.step_limit * self.arm.control_rate
        return self._clock.now() + max(MAX_APPROACH, bend / speed)

    def _check_time(self, end: float) -> None:
        if self._clock.now() > end:
            raise RobotError(
                "the arm does not reach its target in time; it stays where it is: check "
                "the faults of its readings (`s2c2a robot check`)"
            )

    def _send(self, desired: np.ndarray) -> None:
        try:
            EMERGENCY_STOP.check()
        except EmergencyStopError:
            self._robot.halt()
            raise
        if not self._robot.own_time:
            self._gap.check()
        is_sound = self._read()
        limiter = self._limiter
        command = limiter.limit(desired if is_sound else limiter.hold())
        self._robot.send(command.copy())
        self._robot.advance(self._period)
        self._wait()

    def _read(self) -> bool:
        """Log a reading; returns whether it is sound. A single one may be missed."""
        before = self._clock.now()
        reading = self._robot.read()
        moment = (before + self._clock.now()) / 2  # servos are asked one by one
        if not reading.fault:
            self._sound_time = moment
            self.log.times.append(moment)
            self.log.cables.append(reading["cables"])
            return True
        if moment - self._sound_time > FAULT_PATIENCE:
            raise RobotError(f"the arm stopped: {reading.fault}")
        return False

    def _wait(self) -> None:
        """Wait for the next step, and log every frame that arrives."""
        # steps that are late do not make later ones hurry
        self._due = max(self._due + self._period, self._clock.now())
        while True:
            self._log_frame()
            now = self._clock.now()
            if now >= self._due:
                return
            self._clock.wait_until(min(now + POLL_PERIOD, self._due))

    def _log_frame(self) -> None:
        frame = self._tracker.latest()
        if frame is None:
            return
        if self._last is None or not frame.is_same(self._last):
            self.log.frames.append(frame)
        self._last = frame


def limits_at(arm: ArmSpec, rate: float) -> CommandLimits:
    """Return the limits of an arm for commands at another rate [Hz].

    Speed and acceleration stay those of commands at the arm's control rate.
    """
    geometry = ArmGeometry.of(arm)
    ratio = arm.control_rate / rate
    step = np.rad2deg(geometry.step_limit) * ratio
    return CommandLimits.from_degrees(
        arm, step, np.rad2deg(geometry.acceleration_limit) * ratio**2
    )


@contextmanager
def tracked_motion(
    robot: Robot, tracker: Tracker, ends: ModuleEnds
) -> Iterator[TrackedMotion]:
    """Start the tracker, open the robot, and return to rest in the end.

    Raises:
        TrackingError: poses of a body do not arrive; the arm does not move.
    """
    with tracker:
        # the tracker of a simulation has no frame before its time advances
        if not robot.own_time:
            _await_poses(tracker, ends)
        with robot:
            motion = TrackedMotion(robot, tracker)
            try:
                yield motion
            except (EmergencyStopError, RobotError):
                # a halted robot must not move, one with a fault cannot
                raise
            except BaseException:
                motion.rest()
                raise
            motion.rest()


def _await_poses(tracker: Tracker, ends: ModuleEnds) -> None:
    end = time.monotonic() + FIRST_POSES
    while problem := ends.find_missing(tracker):
        if time.monotonic() > end:
            raise TrackingError(
                f"{problem} ({FIRST_POSES:g} s); correct it (docs/guides/tracking.md)"
            )
        time.sleep(POLL_PERIOD)


def chirp(
    arm: ArmSpec,
    duration: float = CHIRP_DURATION,
    frequencies: tuple[float, float] = CHIRP_FREQUENCIES,
) -> Float[np.ndarray, " steps"]:
    """Return the bend of an exponential chirp at the command rate [rad].

    The amplitude falls where the limits of speed (as 1 / f) and acceleration (as
    1 / f^2) of the arm require it, so that the arm moves as fast as it may: the error
    of a latency is that of a position over the speed.

    Args:
        arm: limits of its commands.
        duration: of the chirp [s].
        frequencies: first and last one [Hz].
    """
    times = np.arange(0.0, duration, 1 / COMMAND_RATE)
    first, last = frequencies
    growth = np.log(last / first) / duration
    omega = 2 * np.pi * first * np.exp(growth * times)
    phase = (omega - omega[0]) / growth
    geometry = ArmGeometry.of(arm)
    speed = LIMIT_SHARE * geometry.step_limit * arm.control_rate
    acceleration = LIMIT_SHARE * geometry.acceleration_limit * arm.control_rate**2
    largest = min(np.deg2rad(CHIRP_BEND_DEG), geometry.bend_limits[0] / 2)
    largest = min(largest, geometry.action_bends[0])
    amplitude = np.minimum(largest, np.minimum(speed / omega, acceleration / omega**2))
    ramp = np.clip(np.minimum(times, duration - times) / RAMP, 0.0, 1.0)
    return ramp * amplitude * np.sin(phase)


def measure_latency(
    robot: Robot,
    tracker: Tracker,
    duration: float = CHIRP_DURATION,
    progress: Progress = lambda done, total: None,
) -> Latency:
    """Move the base module of an arm in a chirp, and find the latency of a tracker.

    The base module moves every end. It bends across its first cable: with three
    cables, both directions are then equally stiff.

    Raises:
        TrackingError: no poses arrive, or they do not determine the latency.
        RobotError: the robot has a lasting fault; it stays where it is.
        EmergencyStopError: the emergency stop was triggered.
    """
    ends = ModuleEnds.of_arm(robot.arm)
    with tracked_motion(robot, tracker, ends) as motion:
        bends = chirp(robot.arm, duration)
        first_cable = np.deg2rad(robot.arm.modules[0].cable_angles_deg[0])
        direction = np.array([-np.sin(first_cable), np.cos(first_cable)])
        target = np.zeros((robot.arm.module_count, 2))
        for done, bend in enumerate(bends, 1):
            target[0] = bend * direction
            motion.step(target)
            progress(done, len(bends))
    return find_latency(robot.arm, _record(motion.log, ends))


def _record(log: MotionLog, ends: ModuleEnds) -> MotionRecord:
    names = [name for name in ends.ends if name]
    missing = np.full(3, np.nan)
    positions = [
        [
            frame.poses[name].position if name in frame.poses else missing
            for name in names
        ]
        for frame in log.frames
    ]
    # as in the control loop, the latency is that of frames that are not delayed
    clock = ExposureClock()
    return MotionRecord(
        np.array(log.times),
        np.array(log.cables),
        np.array(
            [clock.exposure(one.arrival_time, one.source_time) for one in log.frames]
        ),
        np.array(positions).reshape(-1, len(names), 3),
    )


def held_bends(arm: ArmSpec) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return bends to hold, and those to pass on the way [rad], shape (modules, 2).

    Every module bends alone along both axes, to either side, in two passes. Friction
    and backlash keep a part of the last motion. So that this averages out, the first
    pass begins with all modules returning to rest from positive bends, and the second
    one, in which signs are reversed and bends are passed before they are held, from
    negative ones.
    """
    geometry = ArmGeometry.of(arm)
    sizes = np.minimum(np.deg2rad(HELD_BEND_DEG), geometry.bend_limits / 2)
    # cables may be shorter than the module can bend
    sizes = np.minimum(sizes, geometry.action_bends / OVERSHOOT)
    all_bent = np.sqrt(0.5) * np.stack([sizes, sizes], axis=1)
    targets = []
    for sign, overshoot in ((1.0, 1.0), (-1.0, OVERSHOOT)):
        targets.append((np.zeros_like(all_bent), sign * all_bent))
        for bend in sign * _single_bends(sizes):
            targets.append((bend, overshoot * bend))
    return targets


def _single_bends(sizes: np.ndarray) -> Float[np.ndarray, "n modules 2"]:
    """Bends of one module and axis at a time, positive, then negative."""
    modules = len(sizes)
    bends = np.zeros((modules, 2, 2, modules, 2))
    for module, size in enumerate(sizes):
        for axis in range(2):
            bends[module, axis, 0, module, axis] = size
            bends[module, axis, 1, module, axis] = -size
    return bends.reshape(-1, modules, 2)


def measure_frames(
    robot: Robot, tracker: Tracker, progress: Progress = lambda done, total: None
) -> Frames:
    """Hold bends of every module, and find the frames of the arm in tracked bodies.

    Raises:
        TrackingError: bodies are missing, or their poses do not fit the arm.
        RobotError: the robot has a lasting fault; it stays where it is.
        EmergencyStopError: the emergency stop was triggered.
    """
    held = []
    ends = ModuleEnds.of_arm(robot.arm)
    if not all(ends.ends):
        raise TrackingError(
            f"tracking.ends are {list(ends.ends)}; track the ends of all modules to "
            "find their frames"
        )
    with tracked_motion(robot, tracker, ends) as motion:
        targets = held_bends(robot.arm)
        for done, (bend, way_point) in enumerate(targets, 1):
            motion.hold(way_point, 0.0)
            motion.hold(bend, SETTLING_TIME)
            motion.log = MotionLog()
            motion.hold(bend, AVERAGING_TIME)
            held.append(_held_poses(robot.arm, motion.log, ends))
            progress(done, len(targets))
    return find_frames(robot.arm, held)


def _held_poses(arm: ArmSpec, log: MotionLog, ends: ModuleEnds) -> HeldPoses:
    cables = np.mean(log.cables, axis=0)
    return HeldPoses(
        bends_of(arm, cables),
        _mean_of(ends.base, log.frames) if ends.base else Pose.identity(),
        tuple(_mean_of(name, log.frames) for name in ends.ends),
    )


def _mean_of(name: str, frames: list[PoseFrame]) -> Pose:
    poses = [frame.poses[name] for frame in frames if name in frame.poses]
    if len(poses) < MIN_HELD_FRAMES:
        known = sorted({body for frame in frames for body in frame.poses})
        raise TrackingError(
            f"'{name}' was tracked in {len(poses)} frames of a held bend; "
            f"{MIN_HELD_FRAMES} are needed. The tracker sees {', '.join(known) or 'none'}"
        )
    return mean_pose(poses)


class CalibrationFile:
    """The calibration file of an arm, which each result changes in part."""

    def __init__(self, arm: ArmSpec, path: Path | None = None):
        """Read the file, if it exists.

        Args:
            arm: that is calibrated.
            path: the file; by default `calibration_path`.

        Raises:
            TrackingError: the file is damaged, or belongs to another arm.
        """
        self._arm = arm
        self._path = path or calibration_path(arm)
        self._calibration = load_or_empty(self._path, arm)

    def store_latency(self, found: Latency) -> Path:
        """Write the latency, and return the path."""
        return self._store(self._calibration.with_latency(found.seconds, found.std))

    def store_frames(self, found: Frames) -> Path:
        """Write the frames, and return the path."""
        names = ModuleEnds.of_arm(self._arm).ends
        pairs = zip(found.position_residuals, found.rotation_residuals, strict=True)
        residuals = [FrameResidual(position=one, rotation=two) for one, two in pairs]
        return self._store(
            self._calibration.with_frames(
                found.base_offset,
                dict(zip(names, found.end_offsets, strict=True)),
                dict(zip(names, residuals, strict=True)),
            )
        )

    def _store(self, calibration: TrackingCalibration) -> Path:
        save_tracking_calibration(calibration, self._path)
        self._calibration = calibration
        return self._path
