"""Conformance test of the robot interface, in simulation or, gently, on hardware.

The control loop drives the robot. An `_InspectedRobot` between them checks every answer,
and tries invalid commands, which the loop would never send, while the arm is at rest.
"""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.episodes.episode import sensor_shapes
from s2c2a.errors import ActionError, S2C2AError
from s2c2a.measurements.readings import describe_values
from s2c2a.robots import Robot
from s2c2a.robots.robot import SETTLING_TIME
from s2c2a.runtime.border import check_meters
from s2c2a.runtime.emergency import EMERGENCY_STOP, EmergencyStopError
from s2c2a.runtime.loop import Loop
from s2c2a.runtime.player import Player, play
from s2c2a.spaces import POSITION, Actions, Reading, Sensor

TEST_BEND = 0.05  # of the full bend; above most backlash, and harmless


def check_robot(robot: Robot) -> list[str]:
    """Open a robot, move it a little and check that it fulfills `Robot`.

    The control loop moves every cable by at most 5 % of its range, and leaves the arm at
    rest, also after a check that failed. It obeys the emergency stop: the robot is then
    halted where it is.

    Returns:
        One line for every check that passed.

    Raises:
        S2C2AError: a check failed; the message says which.
        EmergencyStopError: the emergency stop was triggered.
    """
    EMERGENCY_STOP.check()
    inspected = _InspectedRobot(robot)
    inspected.close()  # before it was opened
    try:
        player = _SmallBend(inspected)
        with Loop(inspected, player) as loop:
            for _ in play(loop, player):
                pass
    except Exception:
        # also where it stopped the way to rest
        EMERGENCY_STOP.check()
        raise
    inspected.close()
    return [
        *inspected.passed,
        "the arm moves as commanded",
        "close() can be called more than once, and before open()",
    ]


class _SmallBend(Player):
    """Bends all modules a little towards x and back, and checks that the arm does.

    Modules whose cables cannot bend them towards x bend towards y.
    """

    def __init__(self, robot: Robot):
        super().__init__(robot.arm, (), self._bend())
        self._sensors = robot.sensors

    def _bend(self) -> Iterator[Actions]:
        geometry = self._geometry
        rest = geometry.action_neutral
        shares = TEST_BEND * self._directions()
        bent = geometry.actions_at(shares)
        yield rest
        before = self.reading
        yield from self.approach(bent)
        yield from self.hold(bent, SETTLING_TIME)
        if "cables" in self._sensors:
            commanded = bent - rest
            change = np.subtract(self.reading["cables"], before["cables"], dtype=float)
            moved = np.sum(change * commanded, axis=-1)
            wanted = np.sum(commanded**2, axis=-1)
            wrong = [
                f"those of module {number + 1} moved "
                f"{100 * moved[number] / wanted[number]:.0f} %"
                for number in np.flatnonzero(wanted)
                if not moved[number] > wanted[number] / 2
            ]
            _require(
                not wrong,
                f"'cables' do not follow: {', '.join(wrong)} of the commanded "
                "displacement: wrong sign, or nothing moves",
            )
        if "states" in self._sensors:
            levers = np.cumsum(geometry.lengths[::-1])[::-1] - geometry.lengths / 2
            sideways = levers @ (shares * geometry.action_bends[:, None])
            shift = (self.reading["states"] - before["states"])[-1, POSITION]
            x, y = sideways / np.linalg.norm(sideways)
            along = shift[0] * x + shift[1] * y
            across = abs(shift[1] * x - shift[0] * y)
            towards = f"({x:.2f}, {y:.2f}) in x and y" if abs(y) > 1e-6 else "+x"
            _require(
                along > 0 and along > 2 * across,
                f"commanded towards {towards}, the tip moved by {shift.round(4)} m",
            )
        yield from self.approach(rest)

    def _directions(self) -> Float[np.ndarray, "modules 2"]:
        """Unit vectors towards which cables bend the modules; zeros for passive ones."""
        steerable = self._geometry.steerable
        if steerable is None:
            return np.tile([1.0, 0.0], (self.arm.module_count, 1))
        towards_x, towards_y = np.moveaxis(steerable, -1, 0)
        bends_to_x = np.linalg.norm(towards_x, axis=-1, keepdims=True) > TEST_BEND
        directions = np.where(bends_to_x, towards_x, towards_y)
        lengths = np.linalg.norm(directions, axis=-1, keepdims=True)
        return directions / np.where(lengths > 0.0, lengths, 1.0)


class _InspectedRobot(Robot):
    """A robot whose answers are checked, until one violates the interface.

    Attributes:
        passed: one line for every check that passed.
    """

    def __init__(self, robot: Robot):
        self._robot = robot
        self.arm = robot.arm
        self.own_time = robot.own_time  # type: ignore[misc]
        self.passed: list[str] = []
        self._geometry = ArmGeometry.of(robot.arm)
        self._scale = np.abs(self._geometry.action_scale)[:, None]
        self._is_inspected = True
        self._has_sent = False
        self._start: tuple[float, float] | None = None
        self._elapsed = 0.0
        self._is_clock_checked = False

    @property
    def sensors(self) -> Mapping[str, Sensor]:
        with self._violations():
            return self._robot.sensors

    def open(self) -> Reading:
        with self._violations():
            first = self._robot.open()
            _require(
                isinstance(first, Reading),
                f"open() returned {first!r}, not the first reading",
            )
            return first

    def read(self) -> Reading:
        with self._violations():
            reading = self._robot.read()
            if self._is_inspected:
                is_first = self._start is None
                passed = [
                    _check_reading(reading, self._robot.sensors),
                    _check_standard_names(reading, self.arm),
                    _check_arm_sensors(self.arm, self._robot.sensors),
                ]
                self._check_clock(reading.time)
                if is_first:
                    self.passed += passed
            return reading

    def send(self, action: Actions) -> Actions:
        with self._violations():
            if self._is_inspected and not self._has_sent:
                self._has_sent = True
                self.passed += [
                    self._check_invalid_actions(),
                    self._check_no_waiting(),
                    self._check_buffers(),
                    self._check_limits(),
                ]
            sent = self._attempt(action.copy())
            if not self._is_inspected:
                return action  # on the way to rest after a violation
            self._require_same(sent, action)
            return sent

    def advance(self, seconds: float) -> None:
        with self._violations():
            self._robot.advance(seconds)
        self._elapsed += seconds

    def halt(self) -> None:
        self._robot.halt()

    def close(self) -> None:
        with self._violations():
            self._robot.close()

    @contextmanager
    def _violations(self) -> Iterator[None]:
        """A foreign exception is a violation; after one, nothing is checked any more."""
        try:
            yield
        except S2C2AError:
            self._is_inspected = False
            raise
        except Exception as error:
            self._is_inspected = False
            raise S2C2AError(
                f"the robot violates the interface: it raised {error!r}; "
                "see s2c2a.robots.Robot"
            ) from error

    def _attempt(self, action: Actions) -> Actions:
        """Send an action, valid or not, unless the emergency stop is triggered."""
        EMERGENCY_STOP.check()
        return self._robot.send(action)

    def _check_clock(self, moment: float) -> None:
        """Check once, after two control periods, that the robot's clock advances."""
        now = self._elapsed if self.own_time else time.perf_counter()
        if self._start is None:
            self._start = now, moment
        duration = now - self._start[0]
        if self._is_clock_checked or duration < 1.5 * self.arm.control_period:
            return
        self._is_clock_checked = True
        measured = moment - self._start[1]
        advice = ""
        if not self.own_time and measured == 0.0:
            advice = (
                ": `Reading.time` must follow the wall clock, or, if time passes in "
                "advance() only, the class must set `own_time = True`"
            )
        _require(
            abs(measured - duration) < 0.5 * duration,
            f"in {duration:.3f} s, its clock advanced by {measured:.3f} s{advice}",
        )
        self.passed.append("the clock advances")

    def _check_invalid_actions(self) -> str:
        shape = self._geometry.action_neutral.shape
        self._check_rejected("NaN", np.full(shape, np.nan))
        self._check_rejected("an action of the wrong shape", np.zeros(shape[0] + 1))
        return "invalid actions raise ActionError before anything moves"

    def _check_rejected(self, name: str, action: np.ndarray) -> None:
        try:
            self._attempt(action)
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

    def _check_no_waiting(self) -> str:
        rest = np.array(self._geometry.action_neutral)
        before = self._robot.read()
        start = time.perf_counter()
        sent = self._attempt(rest)
        middle = time.perf_counter()
        after = self._robot.read()
        duration = max(middle - start, time.perf_counter() - middle)
        self._require_same(sent, self._geometry.action_neutral)
        if self.own_time:
            _require(
                after.time == before.time,
                "time passes in send(); it may pass in advance() only",
            )
            return "time passes in advance() only"
        _require(
            duration < 0.5 * self.arm.control_period,
            f"send() or read() took {1e3 * duration:.0f} ms: they must not wait",
        )
        return "send() and read() return at once"

    def _check_buffers(self) -> str:
        """Check that `send` neither changes its argument nor returns an array twice.

        Readings copy their arrays, so that a robot may use those again.
        """
        rest = self._geometry.action_neutral
        first = np.array(rest + 1e-3 * self._scale)
        for action in (first, first.astype(np.float32)):
            given = action.copy()
            self._attempt(given)
            _require(
                np.array_equal(given, action),
                "send() changes its argument; change a copy, such as action.copy()",
            )
        sent = self._attempt(first.copy())
        kept = np.array(sent)
        other = self._attempt(np.array(rest))
        is_shared = isinstance(sent, np.ndarray) and isinstance(other, np.ndarray)
        _require(
            np.array_equal(kept, sent)
            and not (is_shared and np.shares_memory(sent, other)),
            "send() returns the same array again and changes it; return a copy",
        )
        return "send() keeps its argument and returns a new array"

    def _check_limits(self) -> str:
        """Check that actions beyond the limits are clipped, on simulated robots only."""
        if not self.own_time:
            return (
                "send() returns the action sent "
                "(limits are not tested on a real robot: use `checked_action`)"
            )
        geometry = self._geometry
        low = geometry.action_low - 0.02 * self._scale
        high = geometry.action_high + 0.02 * self._scale
        for beyond in (high + 10 * self._scale, low - 10 * self._scale):
            limited = np.asarray(self._attempt(beyond))
            self._attempt(np.array(geometry.action_neutral))
            inside = (limited >= low) & (limited <= high)
            _require(bool(inside.all()), "send() did not limit a far too large action")
        return "actions stay within the arm's limits"

    def _require_same(self, sent: Actions, action: Actions) -> None:
        """Require that the robot sent an allowed action as it is."""
        _require(
            np.shape(sent) == action.shape,
            f"send() returned {sent!r}, not the action sent",
        )
        _require(
            bool((np.abs(sent - action) <= 0.02 * self._scale).all()),
            "send() of an allowed action returned another action",
        )


def _check_reading(reading: Reading, declared: Mapping[str, Sensor]) -> str:
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
        sensor = declared[name]
        fault = describe_values(name, values, sensor, may_miss=not sensor.always)
        _require(not fault, fault)
    return f"readings contain {', '.join(declared)}, as declared"


def _check_standard_names(reading: Reading, arm: ArmSpec) -> str:
    """Check the shapes of sensors whose name has a fixed meaning."""
    others: dict[str, tuple[int, ...]] = {
        "tensions": (arm.module_count, arm.cable_count),
        "camera_positions": (arm.module_count, 3),
        "camera_age": (),
    }
    for name, shape in (sensor_shapes(arm) | others).items():
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
                np.allclose(lengths, 1.0, atol=1e-3),
                f"axes in '{name}' have lengths {lengths}, not 1",
            )
    for name in ("states", "camera_positions"):
        values = reading.get(name)
        if values is not None:
            check_meters(np.nan_to_num(values[:, POSITION]), arm, f"'{name}'")
    return "sensors with standard names have standard shapes"


def _check_arm_sensors(arm: ArmSpec, sensors: Mapping[str, Sensor]) -> str:
    """Check that the robot provides every sensor that its arm file describes."""
    for key, names in _described_sensors(arm).items():
        missing = [name for name in names if name not in sensors]
        _require(
            not missing,
            f"the arm file has {key}, but the robot provides no {', '.join(missing)} "
            f"(it provides {', '.join(sensors)}); add them to its `sensors` and "
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


def _require(condition: bool, fault: str) -> None:
    if not condition:
        raise _violation(fault)


def _violation(fault: str) -> S2C2AError:
    return S2C2AError(
        f"the robot violates the interface: {fault}; see s2c2a.robots.Robot"
    )
