"""Conformance test of the robot interface, in simulation or, gently, on hardware."""

import math
import time
from collections.abc import Mapping
from contextlib import suppress

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.emergency import EMERGENCY_STOP, EmergencyStopError
from s2c2a.errors import ActionError, S2C2AError
from s2c2a.robots.robot import Robot, checked_action
from s2c2a.spaces import POSITION, Actions, Reading, Sensor

TEST_BEND = 0.05  # of the full bend
SETTLING_TIME = 1.0  # s
POLL_PERIOD = 0.02  # s between looks at the emergency stop
RETURN_PATIENCE = 1.0  # s of failures in a row that end the way to rest, as in the loop


def check_robot(robot: Robot) -> list[str]:
    """Open a robot, move it a little and check that it fulfills `Robot`.

    The test moves every cable by at most 5 % of its range, no faster than the arm's
    step limit, and leaves the arm at rest, also after a check that failed. It obeys the
    emergency stop: the robot is then halted where it is.

    Returns:
        One line for every check that passed.

    Raises:
        S2C2AError: a check failed; the message says which.
        EmergencyStopError: the emergency stop was triggered.
    """
    EMERGENCY_STOP.check()
    try:
        robot.close()  # before it was opened
        try:
            first = robot.open()
            _require(
                isinstance(first, Reading),
                f"open() returned {first!r}, not the first reading",
            )
            passed = _checked_at_rest(robot)
        except EmergencyStopError:
            robot.halt()
            raise
        finally:
            robot.close()
        robot.close()
    except S2C2AError:
        raise
    except Exception as error:
        raise S2C2AError(
            f"the robot violates the interface: it raised {error!r}; "
            "see s2c2a.robots.Robot"
        ) from error
    return [*passed, "close() can be called more than once, and before open()"]


def _checked_at_rest(robot: Robot) -> list[str]:
    """Do all checks of an open robot; a failure or an interrupt ends at rest."""
    geometry = ArmGeometry.of(robot.arm)
    followed = _FollowedRobot(robot)
    try:
        return [check(followed, geometry) for check in CHECKS]
    except EmergencyStopError:
        raise
    except BaseException:
        _return_to_rest(robot, followed.command)
        raise


class _FollowedRobot(Robot):
    """A robot whose last valid command is known, also where `send` failed.

    Attributes:
        command: that command; rest at first.
    """

    def __init__(self, robot: Robot):
        self._robot = robot
        self.arm = robot.arm
        self.own_time = robot.own_time  # type: ignore[misc]
        self.command = ArmGeometry.of(robot.arm).action_neutral

    @property
    def sensors(self) -> Mapping[str, Sensor]:
        return self._robot.sensors

    def open(self) -> Reading:
        return self._robot.open()

    def read(self) -> Reading:
        return self._robot.read()

    def send(self, action: Actions) -> Actions:
        with suppress(ActionError):
            self.command = checked_action(action, ArmGeometry.of(self.arm)).copy()
        return self._robot.send(action)

    def advance(self, seconds: float) -> None:
        self._robot.advance(seconds)

    def close(self) -> None:
        self._robot.close()


def _return_to_rest(robot: Robot, command: Actions) -> None:
    """Move to rest within the limits, past failures, until too many follow each other.

    Raises:
        EmergencyStopError: the arm must not move.
    """
    geometry = ArmGeometry.of(robot.arm)
    if np.array_equal(command, geometry.action_neutral):
        return
    # the arm stands still first, so that it does not reverse in one step
    path = [command, *_path(robot, command, geometry.action_neutral)]
    most = math.ceil(RETURN_PATIENCE * robot.arm.control_rate)
    for action in path:
        for _ in range(most):
            is_sent = _is_sent(robot, action)
            _wait(robot, robot.arm.control_period)
            if is_sent:
                break
        else:
            return


def _is_sent(robot: Robot, action: Actions) -> bool:
    try:
        _send(robot, action.copy())
    except EmergencyStopError:
        raise
    except Exception:  # of the robot; the next attempt may succeed
        return False
    return True


def _check_reading(robot: Robot, geometry: ArmGeometry) -> str:
    reading = robot.read()
    declared = robot.sensors
    _require(
        isinstance(declared, Mapping) and len(declared) > 0,
        f"it declares no sensors by name: {declared!r}",
    )
    _require(isinstance(reading, Reading), f"read() returned {reading!r}, no Reading")
    required = {name for name, sensor in declared.items() if sensor.always}
    missing = sorted(required - set(reading.sensors))
    extra = sorted(set(reading.sensors) - set(declared))
    _require(
        not missing and not extra,
        f"readings lack {missing} and hold {extra}, unlike its `sensors`",
    )
    for name, values in reading.sensors.items():
        _check_values(name, values, declared[name])
    return f"readings contain {', '.join(declared)}, as declared"


def _check_values(name: str, values: np.ndarray, sensor: Sensor) -> None:
    _require(isinstance(values, np.ndarray), f"'{name}' is {values!r}, no array")
    _require(
        values.shape == sensor.shape,
        f"'{name}' has shape {values.shape}, declared as {sensor.shape}",
    )
    _require(values.dtype.kind in "fiub", f"'{name}' holds {values.dtype}, no numbers")
    finite = np.isfinite(values)
    _require(bool(finite.all()) or not sensor.always, f"'{name}' is not finite")
    plausible = (values >= sensor.low) & (values <= sensor.high)
    _require(
        bool(plausible[finite].all()), f"'{name}' is outside its declared low and high"
    )


def _check_standard_names(robot: Robot, geometry: ArmGeometry) -> str:
    """Check the shapes of sensors whose name has a fixed meaning."""
    modules, cables = geometry.action_neutral.shape
    shapes: dict[str, tuple[int, ...]] = {
        "cables": (modules, cables),
        "states": (modules, 6),
        "configurations": (modules, 3),
        "tensions": (modules, cables),
        "camera_positions": (modules, 3),
        "camera_age": (),
    }
    reading = robot.read()
    for name, shape in shapes.items():
        values = reading.get(name)
        _require(
            values is None or values.shape == shape,
            f"'{name}' must have shape {shape} on this arm",
        )
    for name in ("states", "configurations"):
        values = reading.get(name)
        if values is not None:
            lengths = np.linalg.norm(values[:, -3:], axis=-1)
            _require(
                bool(np.allclose(lengths, 1.0, atol=1e-3)),
                f"axes in '{name}' have lengths {lengths}, not 1",
            )
    return "sensors with standard names have standard shapes"


def _check_arm_sensors(robot: Robot, geometry: ArmGeometry) -> str:
    """Check that the robot provides every sensor that its arm file describes."""
    for key, names in _described_sensors(robot.arm).items():
        missing = [name for name in names if name not in robot.sensors]
        _require(
            not missing,
            f"the arm file has {key}, but the robot provides no {', '.join(missing)} "
            f"(it provides {', '.join(robot.sensors)}); add them to its `sensors` and "
            "readings, or correct the arm file",
        )
    return "the robot provides all sensors of the arm file"


def _described_sensors(arm: ArmSpec) -> dict[str, tuple[str, ...]]:
    """Names in readings of the sensors that an arm file describes, by its key."""
    sensors = arm.sensors
    described: dict[str, tuple[str, ...]] = {}
    if arm.sensing == "encoders":
        described['sensing = "encoders"'] = ("cables",)
    if arm.motor.current_noise is not None:
        described["motor.current_noise"] = ("tensions",)
    if sensors.imu is not None:
        described["[sensors.imu]"] = ("accelerations", "angular_velocities")
    if sensors.camera is not None:
        described["[sensors.camera]"] = ("camera_positions", "camera_age")
    if sensors.flex is not None:
        described["[sensors.flex]"] = ("flex",)
    if sensors.raw:
        described["[[sensors.raw]]"] = tuple(sensor.name for sensor in sensors.raw)
    return described


def _check_motion(robot: Robot, geometry: ArmGeometry) -> str:
    """Check that a small bend towards x arrives, with the right sign."""
    before = robot.read()
    scale = geometry.action_scale[:, None]
    towards_x = scale * TEST_BEND * geometry.cable_matrices[:, :, 0]
    target = geometry.action_neutral + towards_x
    _move(robot, geometry.action_neutral, target)
    _check_displacement(robot, before, robot.read(), towards_x)
    _move(robot, target, geometry.action_neutral)
    return "the arm moves as commanded"


def _check_displacement(
    robot: Robot, before: Reading, after: Reading, towards_x: Actions
) -> None:
    if "cables" in robot.sensors:
        change = np.subtract(after["cables"], before["cables"], dtype=float)
        moved = change * towards_x
        shares = 100 * moved.sum(axis=-1) / np.sum(towards_x**2, axis=-1)
        wrong = [
            f"those of module {number} moved {share:.0f} %"
            for number, share in enumerate(shares, start=1)
            if not share > 50
        ]
        _require(
            not wrong,
            f"'cables' do not follow: {', '.join(wrong)} of the commanded "
            "displacement: wrong sign, or nothing moves",
        )
    if "states" in robot.sensors:
        displacement = after["states"][-1, POSITION] - before["states"][-1, POSITION]
        _require(
            displacement[0] > 0 and displacement[0] > 2 * abs(displacement[1]),
            f"commanded towards +x, the tip moved by {displacement.round(4)} m",
        )


def _check_buffers(robot: Robot, geometry: ArmGeometry) -> str:
    """Check that `send` neither changes its argument nor returns the same array twice.

    Readings copy their arrays, so that a robot may use those again.
    """
    small = 1e-3 * np.abs(geometry.action_scale)[:, None]
    first = np.array(geometry.action_neutral + small)
    for action in (first, first.astype(np.float32)):
        given = action.copy()
        _send(robot, given)
        _require(
            bool(np.array_equal(given, action)),
            "send() changes its argument; change a copy, such as action.copy()",
        )
    sent = _send(robot, first.copy())
    kept = np.array(sent)
    other = _send(robot, np.array(geometry.action_neutral))
    is_shared = isinstance(sent, np.ndarray) and isinstance(other, np.ndarray)
    _require(
        bool(np.array_equal(kept, sent))
        and not (is_shared and np.shares_memory(sent, other)),
        "send() returns the same array again and changes it; return a copy",
    )
    return "send() keeps its argument and returns a new array"


def _check_clock(robot: Robot, geometry: ArmGeometry) -> str:
    start = robot.read()
    duration = 2 * robot.arm.control_period
    _wait(robot, duration)
    measured = robot.read().time - start.time
    advice = ""
    if not robot.own_time and measured == 0.0:
        advice = (
            ": `Reading.time` must follow the wall clock, or, if time passes in "
            "advance() only, the class must set `own_time = True`"
        )
    _require(
        abs(measured - duration) < 0.5 * duration,
        f"in {duration:.3f} s, its clock advanced by {measured:.3f} s{advice}",
    )
    return "the clock advances"


def _check_no_waiting(robot: Robot, geometry: ArmGeometry) -> str:
    if robot.own_time:
        before = robot.read().time
        _send(robot, geometry.action_neutral)
        _require(
            robot.read().time == before,
            "time passes in send(); it may pass in advance() only",
        )
        return "time passes in advance() only"
    start = time.perf_counter()
    _send(robot, geometry.action_neutral)
    sent = time.perf_counter()
    robot.read()
    duration = max(sent - start, time.perf_counter() - sent)
    _require(
        duration < 0.5 * robot.arm.control_period,
        f"send() or read() took {1e3 * duration:.0f} ms: they must not wait",
    )
    return "send() and read() return at once"


def _check_limits(robot: Robot, geometry: ArmGeometry) -> str:
    """Check that actions beyond the limits are clipped, on simulated robots only."""
    sent = _send(robot, geometry.action_neutral + 1e-9)
    _require(
        np.shape(sent) == geometry.action_neutral.shape,
        f"send() returned {sent!r}, not the action sent",
    )
    if not robot.own_time:
        return (
            "send() returns the action sent "
            "(limits are not tested on a real robot: use `checked_action`)"
        )
    scale = np.abs(geometry.action_scale)[:, None]
    low = geometry.action_low - 0.02 * scale
    high = geometry.action_high + 0.02 * scale
    for action in (geometry.action_high + 10 * scale, geometry.action_low - 10 * scale):
        limited = np.asarray(_send(robot, action))
        _send(robot, geometry.action_neutral)
        inside = (limited >= low) & (limited <= high)
        _require(bool(inside.all()), "send() did not limit a far too large action")
    return "actions stay within the arm's limits"


def _check_invalid_actions(robot: Robot, geometry: ArmGeometry) -> str:
    shape = geometry.action_neutral.shape
    _check_rejected(robot, "NaN", np.full(shape, np.nan))
    _check_rejected(robot, "an action of the wrong shape", np.zeros(shape[0] + 1))
    return "invalid actions raise ActionError before anything moves"


def _check_rejected(robot: Robot, name: str, action: np.ndarray) -> None:
    try:
        _send(robot, action)
    except ActionError:
        return
    except EmergencyStopError:
        raise
    except Exception as error:
        raise _violation(
            f"send() of {name} raised {error!r}; it must raise ActionError"
        ) from error
    raise _violation(
        f"send() accepted {name}; it must raise ActionError before anything moves"
    )


CHECKS = (
    _check_reading,
    _check_standard_names,
    _check_arm_sensors,
    _check_invalid_actions,
    _check_no_waiting,
    _check_buffers,
    _check_clock,
    _check_motion,
    _check_limits,
)


def _move(robot: Robot, start: Actions, end: Actions) -> None:
    """Move from one action to another within the limits, then let it settle."""
    geometry = ArmGeometry.of(robot.arm)
    tolerance = 0.02 * np.abs(geometry.action_scale)[:, None]
    for action in _path(robot, start, end):
        sent = np.asarray(_send(robot, action))
        _require(
            sent.shape == action.shape, f"send() returned {sent!r}, not the action sent"
        )
        _require(
            bool((np.abs(sent - action) <= tolerance).all()),
            "send() of an allowed action returned another action",
        )
        _wait(robot, robot.arm.control_period)
    _wait(robot, SETTLING_TIME)


def _path(robot: Robot, start: Actions, end: Actions) -> list[Actions]:
    """Actions from one to another within the limits, for an arm at rest."""
    geometry = ArmGeometry.of(robot.arm)
    shares = np.abs(end - start) / np.abs(geometry.action_scale)[:, None]
    bend = float((shares.max(axis=-1) * geometry.action_bends).max())
    # it starts and stops: the whole first change is an acceleration
    largest = min(geometry.step_limit, geometry.acceleration_limit)
    steps = math.ceil(bend / largest)
    return [
        start + share * (end - start) for share in np.linspace(0.0, 1.0, steps + 1)[1:]
    ]


def _send(robot: Robot, action: Actions) -> Actions:
    """Send an action, unless the emergency stop is triggered.

    Raises:
        EmergencyStopError: it is.
    """
    EMERGENCY_STOP.check()
    return robot.send(action)


def _wait(robot: Robot, seconds: float) -> None:
    """Wait, unless the emergency stop is triggered.

    Raises:
        EmergencyStopError: it is; nothing is sent any more.
    """
    if robot.own_time:
        EMERGENCY_STOP.check()
        robot.advance(seconds)
    end = time.monotonic() + (0.0 if robot.own_time else seconds)
    while (remaining := end - time.monotonic()) > 0:
        EMERGENCY_STOP.check()
        time.sleep(min(POLL_PERIOD, remaining))
    EMERGENCY_STOP.check()


def _require(condition: bool, fault: str) -> None:
    if not condition:
        raise _violation(fault)


def _violation(fault: str) -> S2C2AError:
    return S2C2AError(
        f"the robot violates the interface: {fault}; see s2c2a.robots.Robot"
    )
