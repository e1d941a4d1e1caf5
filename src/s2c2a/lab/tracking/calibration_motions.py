"""Motions of an arm that calibrate its tracker: latency and frames.

The control loop plays them, with more control steps a second than otherwise and the same
largest speed and acceleration.
"""

import hashlib
import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec, arm_to_toml
from s2c2a.arm.spec import counts_of
from s2c2a.errors import RobotError, counted
from s2c2a.lab.tracking import ModuleEnds, Pose, PoseFrame, Tracker, TrackingError
from s2c2a.lab.tracking.calibration import (
    FrameResidual,
    TrackingCalibration,
    TrackingCalibrationError,
    calibration_path,
    load_or_empty,
    save_tracking_calibration,
)
from s2c2a.lab.tracking.clock import ExposureClock
from s2c2a.lab.tracking.frames import Frames, HeldPoses, find_frames, mean_pose
from s2c2a.lab.tracking.latency import Latency, MotionRecord, find_latency
from s2c2a.lab.tracking.states import await_poses
from s2c2a.robots import Robot
from s2c2a.runtime import Clock, Loop, Patience, Player, StepClock, WallClock, play
from s2c2a.runtime.limits import arm_at
from s2c2a.spaces import Actions, Reading

COMMAND_RATE = 50.0  # Hz
POLL_PERIOD = 0.002  # s
CHIRP_DURATION = 40.0  # s
CHIRP_FREQUENCIES = (0.15, 2.5)  # Hz
CHIRP_BEND_DEG = 12.0
LIMIT_SHARE = 0.7  # of the limits of rate and acceleration
FADE = 0.03  # of a chirp, at both ends
HELD_BEND_DEG = 15.0
OVERSHOOT = 1.3
SETTLING_TIME = 2.0  # s; vibration decays
AVERAGING_TIME = 1.0  # s
MIN_HELD_FRAMES = 10
LATE_PATIENCE = 5.0  # s; a computer that is busy for a moment recovers sooner
MotionProgress = Callable[[int, int], None]


class FrameClock(Clock):
    """A clock that collects the frames of a tracker while the control loop waits.

    Attributes:
        frames: all new ones.
        woke: end of the last wait [s], when the robot is read.
    """

    def __init__(self, tracker: Tracker, clock: Clock):
        """A clock without frames.

        Args:
            tracker: started; its arrival times are on the same clock.
            clock: that tells the time.
        """
        self._tracker = tracker
        self._clock = clock
        self._last: PoseFrame | None = None
        self.frames: list[PoseFrame] = []
        self.woke = clock.now()

    def now(self) -> float:
        return self._clock.now()

    def with_sleep(self) -> float:
        return self._clock.with_sleep()

    def wait_until(self, moment: float) -> None:
        """Wait, and look for new frames meanwhile."""
        self._look()
        while (now := self.now()) < moment:
            self._clock.wait_until(min(now + POLL_PERIOD, moment))
            self._look()
        self.woke = self.now()

    def _look(self) -> None:
        frame = self._tracker.latest()
        if frame is None:
            return
        if self._last is None or not frame.is_same(self._last):
            self.frames.append(frame)
        self._last = frame


class TrackedPlayer(Player):
    """Plays bends, and logs sound readings and frames.

    Attributes:
        times: of the readings since the log began, on the clock of the tracker [s].
        cables: of the readings [m or N].
        late: readings that took longer than a control period: they are not logged,
            since nobody knows when they were measured.
        late_since: time of the first one after the last that was not late [s].
        duration: of the last reading [s].
    """

    late = 0
    late_since = math.inf
    duration = 0.0

    def __init__(self, arm: ArmSpec, clock: FrameClock):
        """A player without a motion (`play_motion`).

        Args:
            arm: at the rate of the commands.
            clock: of the control loop.
        """
        super().__init__(arm, ("cables",))
        self._clock = clock
        self.begin_log()

    @property
    def frames(self) -> list[PoseFrame]:
        """New frames since the log began."""
        return self._clock.frames[self._first_frame :]

    def begin_log(self) -> None:
        """Begin a new log."""
        self.times: list[float] = []
        self.cables: list[np.ndarray] = []
        self._first_frame = len(self._clock.frames)

    def estimate(self, reading: Reading, last_command: Actions) -> Reading:
        """The reading itself, which is logged unless it is late."""
        now = self._clock.now()
        self.duration = now - self._clock.woke
        if self.duration > self.arm.control_period:
            self.late += 1
            self.late_since = min(self.late_since, now)
        else:
            self.late_since = math.inf
            # servos are asked one by one
            self.times.append((self._clock.woke + now) / 2)
            self.cables.append(reading["cables"])
        return super().estimate(reading, last_command)

    def action(self, bends: Float[np.ndarray, "modules 2"]) -> Actions:
        """Return the command for bends [rad].

        Raises:
            RobotError: the cables do not reach these bends.
        """
        geometry = self._geometry
        target = geometry.actions_at(bends / geometry.action_bends[:, None])
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
        # the last digits may be beyond a limit, and would never be reached
        return np.clip(target, geometry.action_low, geometry.action_high)


def play_motion(
    robot: Robot,
    tracker: Tracker,
    motion: Callable[[TrackedPlayer], Iterable[Actions]],
    clock: Clock | None = None,
) -> TrackedPlayer:
    """Start the tracker, play a motion on the control loop, and return to rest.

    Args:
        robot: that moves.
        tracker: of its module ends.
        motion: the commands of a player.
        clock: by default the wall clock, or a `StepClock` for a simulation.

    Returns:
        The player, with what it logged.

    Raises:
        TrackingError: poses of a body do not arrive; the arm does not move.
        RobotError: the robot has a lasting fault, all readings are late, or the program
            stood still.
        EmergencyStopError: the emergency stop was triggered.
    """
    clock = clock or (StepClock() if robot.own_time else WallClock())
    with tracker:
        # the tracker of a simulation has no frame before its time advances
        if not robot.own_time:
            ends = ModuleEnds.of_arm(robot.arm)
            await_poses(
                lambda: ends.find_missing(tracker),
                "correct it (docs/guides/tracking.md)",
            )
        frames = FrameClock(tracker, clock)
        player = TrackedPlayer(arm_at(robot.arm, COMMAND_RATE), frames)
        player.motion = motion(player)
        patience = Patience.of(COMMAND_RATE)
        with Loop(
            robot,
            player,
            frames,
            patience=patience,
            rate=COMMAND_RATE,
        ) as loop:
            for _ in play(loop, player):
                if clock.now() - player.late_since > LATE_PATIENCE:
                    raise RobotError(
                        f"for {LATE_PATIENCE:g} s all readings took more than "
                        f"{1000 / COMMAND_RATE:g} ms (the last one "
                        f"{1000 * player.duration:.0f} ms); check the bus "
                        "(`s2c2a motors timing`) and the latency of its adapter, then "
                        "start again"
                    )
    if player.late:
        warnings.warn(
            f"{counted(player.late, 'reading')} of more than {1000 / COMMAND_RATE:g} ms "
            "left out; close other programs of this computer if there are many",
            stacklevel=1,
        )
    return player


def base_chirp(
    arm: ArmSpec, duration: float = CHIRP_DURATION
) -> Float[np.ndarray, " steps"]:
    """Bend of the first module with cables in an exponential chirp [rad].

    The amplitude falls where the limits of speed (as 1 / f) and acceleration (as
    1 / f^2) of the arm require it, so that the arm moves as fast as it may.

    Args:
        arm: limits of its commands.
        duration: of the chirp, at the command rate [s].
    """
    geometry = ArmGeometry.of(arm)
    driven = _first_driven(arm)
    largest = min(np.deg2rad(CHIRP_BEND_DEG), geometry.bend_limits[driven] / 2)
    amplitude = min(largest, geometry.action_bends[driven])
    times = np.arange(round(duration * COMMAND_RATE)) / COMMAND_RATE
    first, last = CHIRP_FREQUENCIES
    growth = np.log(last / first) / duration
    omega = 2.0 * np.pi * first * np.exp(growth * times)
    by_speed = geometry.step_limit * arm.control_rate / omega
    by_acceleration = geometry.acceleration_limit * arm.control_rate**2 / omega**2
    allowed = LIMIT_SHARE * np.minimum(by_speed, by_acceleration)
    near = np.minimum(times, duration - times)
    fade = np.minimum(1.0, near / (FADE * duration))
    wave = fade * np.sin((omega - omega[0]) / growth)
    return wave * np.minimum(amplitude, allowed)


def _first_driven(arm: ArmSpec) -> int:
    """Index of the first module with cables, which moves every end beyond it."""
    return next(index for index, count in enumerate(counts_of(arm.modules)) if count)


def measure_latency(
    robot: Robot,
    tracker: Tracker,
    duration: float = CHIRP_DURATION,
    progress: MotionProgress = lambda done, total: None,
) -> Latency:
    """Move the base module of an arm in a chirp, and find the latency of a tracker.

    The base module moves every end. It bends across its first cable: with three
    cables, both directions are then equally stiff.

    Raises:
        TrackingError: no poses arrive, or they do not determine the latency.
        RobotError: the robot has a lasting fault; it goes to rest.
        EmergencyStopError: the emergency stop was triggered.
    """
    bends = base_chirp(robot.arm, duration)
    first = _first_driven(robot.arm)
    module = robot.arm.modules[first]
    first_cable = np.deg2rad(module.cable_angles_deg[0])
    direction = np.array([-np.sin(first_cable), np.cos(first_cable)])
    if module.is_planar:
        direction = np.array([np.cos(first_cable), np.sin(first_cable)])

    def motion(player: TrackedPlayer) -> Iterator[Actions]:
        target = np.zeros((robot.arm.module_count, 2))
        for done, bend in enumerate(bends, 1):
            target[first] = bend * direction
            yield player.action(target)
            progress(done, len(bends))

    player = play_motion(robot, tracker, motion)
    record = _record(player, ModuleEnds.of_arm(robot.arm))
    return find_latency(robot.arm, record)


def _record(player: TrackedPlayer, ends: ModuleEnds) -> MotionRecord:
    names = [name for name in ends.ends if name]
    missing = np.full(3, np.nan)
    positions = [
        [
            frame.poses[name].position if name in frame.poses else missing
            for name in names
        ]
        for frame in player.frames
    ]
    # as in the control loop, the latency is that of frames that are not delayed
    clock = ExposureClock()
    return MotionRecord(
        np.array(player.times),
        np.array(player.cables),
        np.array(
            [clock.exposure(one.arrival_time, one.source_time) for one in player.frames]
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
    robot: Robot,
    tracker: Tracker,
    file: "CalibrationFile",
    progress: MotionProgress = lambda done, total: None,
) -> Frames:
    """Hold bends of every module, and find the frames of the arm in tracked bodies.

    Args:
        robot: that moves.
        tracker: of its module ends.
        file: that keeps every held bend until the end. Bends that were held before an
            interruption are only passed, since friction remembers the way.
        progress: called after every held bend.

    Raises:
        TrackingError: bodies are missing, or their poses do not fit the arm.
        RobotError: the robot has a lasting fault; it goes to rest.
        EmergencyStopError: the emergency stop was triggered.
    """
    held = file.held()
    before = len(held)
    ends = ModuleEnds.of_arm(robot.arm)
    if not all(ends.ends):
        raise TrackingError(
            f"tracking.ends are {list(ends.ends)}; track the ends of all modules to "
            "find their frames"
        )
    targets = held_bends(robot.arm)

    def motion(player: TrackedPlayer) -> Iterator[Actions]:
        for done, (bend, way_point) in enumerate(targets, 1):
            target = player.action(bend)
            yield from player.approach(player.action(way_point))
            yield from player.approach(target)
            if done > before:
                yield from player.hold(target, SETTLING_TIME)
                player.begin_log()
                yield from player.hold(target, AVERAGING_TIME)
                while not player.cables:
                    yield target  # all readings were late
                held.append(_held_poses(robot.arm, player, ends))
                file.store_held(held)
            progress(done, len(targets))

    play_motion(robot, tracker, motion)
    file.store_held(())
    return find_frames(robot.arm, held)


def _held_poses(arm: ArmSpec, player: TrackedPlayer, ends: ModuleEnds) -> HeldPoses:
    frames = player.frames
    return HeldPoses(
        ArmGeometry.of(arm).commanded_bends(np.mean(player.cables, axis=0)),
        _mean_of(ends.base, frames) if ends.base else Pose.identity(),
        tuple(_mean_of(name, frames) for name in ends.ends),
    )


def _mean_of(name: str, frames: list[PoseFrame]) -> Pose:
    poses = [frame.poses[name] for frame in frames if name in frame.poses]
    if len(poses) < MIN_HELD_FRAMES:
        known = sorted({body for frame in frames for body in frame.poses})
        raise TrackingError(
            f"'{name}' was tracked in {counted(len(poses), 'frame')} of a held bend; "
            f"{MIN_HELD_FRAMES} are needed. The tracker sees {', '.join(known) or 'none'}"
        )
    return mean_pose(poses)


class CalibrationFile:
    """The calibration file of an arm, which each result changes in part."""

    def __init__(
        self, arm: ArmSpec, path: Path | None = None, setup: Sequence[object] = ()
    ):
        """Read the file, if it exists.

        Args:
            arm: that is calibrated.
            path: the file; by default `calibration_path`.
            setup: all but the arm that must not change before its frames are held.

        Raises:
            TrackingError: the file is damaged, or belongs to another arm.
        """
        self._arm = arm
        self._path = path or calibration_path(arm)
        self._calibration = load_or_empty(self._path, arm)
        content = repr((arm_to_toml(arm), *map(str, setup)))
        self._setup = hashlib.sha256(content.encode()).hexdigest()[:16]

    @property
    def last_held(self) -> datetime | None:
        """When the last bend of unfinished frames was held."""
        unfinished = self._calibration.unfinished
        return unfinished.date if unfinished else None

    def held(self) -> list[HeldPoses]:
        """Return the poses of unfinished frames, in the order of `held_bends`.

        Raises:
            TrackingError: they are of another arm or setup, or of other bends.
        """
        unfinished = self._calibration.unfinished
        if unfinished is None:
            return []
        held = [one.held for one in unfinished.held]
        targets = np.array([bend for bend, _ in held_bends(self._arm)])
        # half way to a bend, it is that or none
        room = np.abs(targets).max() / 2
        if (
            unfinished.setup != self._setup
            or len(held) > len(targets)
            or any(
                one.bends.shape != target.shape
                or len(one.ends) != len(target)
                or np.abs(one.bends - target).max() > room
                for one, target in zip(held, targets, strict=False)
            )
        ):
            raise TrackingCalibrationError(
                f"{self._path} has unfinished frames of {unfinished.date:%Y-%m-%d %H:%M} "
                "that do not belong to this arm file, robot, homing and tracking source; "
                "begin again with --overwrite"
            )
        return held

    def store_held(self, held: Sequence[HeldPoses]) -> None:
        """Write the poses of unfinished frames; none forgets those before."""
        self._store(self._calibration.with_unfinished(self._setup, held))

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
