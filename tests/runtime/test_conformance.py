"""The conformance test passes valid robots and names the violation of others."""

import time
from dataclasses import replace

import numpy as np
import pytest
from puppets import Puppet  # type: ignore[import-not-found]

from s2c2a.arm import ArmGeometry
from s2c2a.arm.sensors import Camera, Inertial, Sensors
from s2c2a.errors import S2C2AError
from s2c2a.robots import checked_action
from s2c2a.robots.simulation import FIDELITIES, SimulatedRobot
from s2c2a.runtime import WallClock, check_robot
from s2c2a.runtime.emergency import EMERGENCY_STOP, EmergencyStopError
from s2c2a.spaces import Sensor


class _CountingRobot(SimulatedRobot):
    """A conforming robot that counts calls of close(); subclasses violate one rule."""

    closed = 0

    def close(self):
        self.closed += 1


def _replace_sensors(reading, **sensors):
    """Return the reading with other values of some sensors; None removes one."""
    said = {**reading.sensors, **sensors}
    return replace(
        reading,
        sensors={name: values for name, values in said.items() if values is not None},
    )


def misreading(change, **declared):
    """A robot whose readings have other values of some sensors, and its declaration."""

    class Misreading(_CountingRobot):
        @property
        def sensors(self):
            return super().sensors | declared

        def read(self):
            return _replace_sensors(super().read(), **change(self))

    return Misreading


def _flat(robot):
    return {"configurations": robot.configurations().ravel()}


class _DeclaresNothing(_CountingRobot):
    @property
    def sensors(self):
        return {}


class _SendReturnsAnotherAction(_CountingRobot):
    def send(self, action):
        return super().send(action) + 0.001


class _SendReturnsNothing(_CountingRobot):
    def send(self, action):
        super().send(action)


class _ClockStops(_CountingRobot):
    def read(self):
        return replace(super().read(), time=0.0)


class _ClockRuns(_CountingRobot):
    def read(self):
        reading = super().read()
        return replace(reading, time=10.0 * reading.time)


class _AdvancesInSend(_CountingRobot):
    def send(self, action):
        sent = super().send(action)
        self.advance(self.arm.control_period)
        return sent


class _DoesNotMove(_CountingRobot):
    def advance(self, seconds):
        self._motors = self._command = self._geometry.action_neutral
        super().advance(seconds)


class _MovesInTheWrongDirection(_CountingRobot):
    def send(self, action):
        sent = checked_action(action, self._geometry)
        super().send(2 * self._geometry.action_neutral - sent)
        return sent


class _CablesAreCrossed(_CountingRobot):
    """Cables are permuted: sensors and motors agree, but the arm bends elsewhere."""

    def send(self, action):
        sent = super().send(action)
        self._command = np.roll(self._command, 1, axis=-1)
        return sent

    def read(self):
        reading = super().read()
        return _replace_sensors(reading, cables=np.roll(reading["cables"], -1, axis=-1))


class _ReturnsTheRequestedAction(_CountingRobot):
    """It clips actions but returns the unclipped ones."""

    def send(self, action):
        super().send(action)
        return np.array(action, dtype=float)


class _AcceptsNaN(_CountingRobot):
    def send(self, action):
        return super().send(np.nan_to_num(action))


class _AcceptsAnyShape(_CountingRobot):
    def send(self, action):
        return super().send(np.resize(action, self._geometry.action_neutral.shape))


class _RaisesValueError(_CountingRobot):
    def send(self, action):
        values = np.asarray(action)
        if values.ndim != 2 or not np.isfinite(values).all():
            raise ValueError("no")
        return super().send(action)


class _ChangesItsArgument(_CountingRobot):
    def send(self, action):
        sent = super().send(action)
        action *= 1000
        return sent


class _ReusesItsBuffer(_CountingRobot):
    def send(self, action):
        if not hasattr(self, "_out"):
            self._out = np.zeros(np.shape(action))
        self._out[...] = super().send(action)
        return self._out


class _ReturnsViewsOfItsBuffer(_ReusesItsBuffer):
    def send(self, action):
        return super().send(action)[:]


FAULTS = {
    "too many cables": (
        misreading(lambda robot: {"cables": np.zeros((3, 4))}),
        r"'cables' has shape \(3, 4\), declared as \(3, 3\)",
    ),
    "cables that are NaN": (
        misreading(lambda robot: {"cables": np.full((3, 3), np.nan)}),
        "'cables' is not finite",
    ),
    "states without axes": (
        misreading(lambda robot: {"states": robot.states()[:, :3]}),
        "'states' has shape",
    ),
    "long axes": (
        misreading(lambda robot: {"states": 2.0 * robot.states()}),
        "axes in 'states' have lengths",
    ),
    "states in millimeters": (
        misreading(lambda robot: {"states": robot.states() * ([1000.0] * 3 + [1] * 3)}),
        "'states' has a coordinate of 600 m, .*write lengths in meters",
    ),
    "flat configurations": (misreading(_flat), "'configurations' has shape"),
    "declared as flat": (
        misreading(_flat, configurations=Sensor((9,), "1")),
        "'configurations' must have shape",
    ),
    "no states": (
        misreading(lambda robot: {"states": None}),
        r"readings lack \['states'\]",
    ),
    "undeclared": (
        misreading(lambda robot: {"flex": np.zeros(3)}),
        r"hold \['flex'\], unlike its `sensors`",
    ),
    "beyond its own range": (
        misreading(lambda robot: {}, states=Sensor((3, 6), "m, 1", high=0.5)),
        "'states' is out of its range",
    ),
    "DeclaresNothing": (_DeclaresNothing, "declares no sensors by name"),
    "SendReturnsAnotherAction": (_SendReturnsAnotherAction, "returned another"),
    "SendReturnsNothing": (_SendReturnsNothing, "send"),
    "ClockStops": (_ClockStops, "its clock advanced by 0.000 s"),
    "ClockRuns": (_ClockRuns, "its clock advanced by 2.000 s"),
    "AdvancesInSend": (_AdvancesInSend, "time passes in send"),
    "DoesNotMove": (_DoesNotMove, "wrong sign, or nothing moves"),
    "MovesInTheWrongDirection": (
        _MovesInTheWrongDirection,
        "those of module 3 moved -1.. %",
    ),
    "CablesAreCrossed": (_CablesAreCrossed, r"commanded towards \+x, the tip moved"),
    "ReturnsTheRequestedAction": (
        _ReturnsTheRequestedAction,
        "did not limit a far too large action",
    ),
    "AcceptsNaN": (_AcceptsNaN, "accepted NaN"),
    "AcceptsAnyShape": (_AcceptsAnyShape, "wrong shape"),
    "RaisesValueError": (_RaisesValueError, "ActionError"),
    "ChangesItsArgument": (_ChangesItsArgument, "changes its argument"),
    "ReusesItsBuffer": (_ReusesItsBuffer, "returns the same array again"),
    "ReturnsViewsOfItsBuffer": (
        _ReturnsViewsOfItsBuffer,
        "returns the same array again",
    ),
}


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("preset", ["twin", "simulated"])
def test_the_presets_conform_in_every_fidelity(preset, fidelity, request):
    check_robot(SimulatedRobot(request.getfixturevalue(preset), fidelity))


@pytest.mark.parametrize(("kind", "fault"), FAULTS.values(), ids=FAULTS)
def test_a_violation_is_named_and_the_robot_closed(kind, fault, twin):
    robot = kind(twin)
    with pytest.raises(S2C2AError, match=fault):
        check_robot(robot)
    assert robot.closed == 2  # before it was opened, and after the fault


def test_a_robot_that_rounds_to_encoder_ticks_conforms(twin):
    class Rounding(SimulatedRobot):
        def send(self, action):
            return 1e-4 * np.round(super().send(action) / 1e-4)

    check_robot(Rounding(twin))


def test_a_camera_without_an_image_in_most_readings_conforms(twin):
    sensors = Sensors(imu=Inertial(), camera=Camera())
    check_robot(SimulatedRobot(twin.model_copy(update={"sensors": sensors})))


def test_a_robot_without_ground_truth_conforms(twin):
    class Unwatched(SimulatedRobot):
        @property
        def sensors(self):
            return {"cables": super().sensors["cables"]}

        def read(self):
            return _replace_sensors(super().read(), states=None, configurations=None)

    check_robot(Unwatched(twin))


def test_the_check_is_gentle(twin):
    sent = []

    class Recorder(SimulatedRobot):
        def send(self, action):
            sent.append(super().send(action))
            return sent[-1]

    check_robot(Recorder(twin))
    geometry = Recorder(twin)._geometry
    moves = [one for one in sent if np.abs(one / geometry.action_high).max() < 0.5]
    # that limits hold is tried at both ends: no time passes then
    assert len(moves) == len(sent) - 2
    assert np.max(np.abs(moves) / geometry.action_high) == pytest.approx(0.05)


@pytest.fixture
def real(make_arm, monkeypatch):
    """Function that makes a conforming robot whose time passes."""
    monkeypatch.setattr("s2c2a.runtime.conformance.SETTLING_TIME", 0.01)
    return lambda rate=20.0, **changes: Puppet(
        make_arm(1, control_rate=rate, **changes), WallClock()
    )


def test_a_wall_clock_robot_conforms_and_its_limits_are_not_tested(real):
    robot = real(100.0)
    kept = check_robot(robot)
    assert "send() and read() return at once" in kept
    assert any("limits are not tested on a real robot" in one for one in kept)
    assert robot.notes.count("close") >= 3


@pytest.mark.parametrize("method", ["send", "read"])
def test_a_wall_clock_robot_that_blocks_is_named_and_closed(real, method):
    robot = real()
    setattr(robot, f"before_{method}", lambda _: time.sleep(robot.arm.control_period))
    fault = r"send\(\) or read\(\) took .* ms: they must not wait"
    with pytest.raises(S2C2AError, match=fault):
        check_robot(robot)
    assert robot.notes.count("close") == 2


def test_a_wall_clock_robot_whose_clock_stops_is_named_and_closed(real):
    robot = real()
    read = robot.read
    robot.read = lambda: replace(read(), time=0.0)
    fault = r"its clock advanced by 0.000 s: .*own_time = True"
    with pytest.raises(S2C2AError, match=fault):
        check_robot(robot)
    assert robot.notes.count("close") == 2


@pytest.mark.parametrize(
    ("sensors", "lacking"),
    [
        (Sensors(imu=Inertial()), "no accelerations, angular_velocities"),
        (Sensors(camera=Camera()), "no camera_positions, camera_age"),
    ],
)
def test_a_sensor_of_the_arm_file_that_the_robot_lacks_is_named(sensors, lacking, real):
    with pytest.raises(S2C2AError, match=f"the arm file has .*provides {lacking}"):
        check_robot(real(sensors=sensors))


AT_REST = 12  # calls of `send` before the arm moves


class _FailsOnItsWay(_CountingRobot):
    """Its `send` fails in some calls, counted from the opening.

    Attributes:
        commands: that it followed in every call; where it fails, the one before.
        stop_at: number of the call in which the emergency stop is triggered.
        halted: number of calls before each halt.
    """

    failures = ()
    error = RuntimeError("a plug came off")
    stop_at = 0
    commands = None  # it sends while it settles

    def open(self):
        self.halted = []
        reading = super().open()
        self.commands = []
        return reading

    def send(self, action):
        if self.commands is None:
            return super().send(action)
        before = self.commands[-1] if self.commands else self._geometry.action_neutral
        valid = np.shape(action) == before.shape
        fails = len(self.commands) + 1 in self.failures
        self.commands.append(np.array(action) if valid and not fails else before)
        if len(self.commands) == self.stop_at:
            EMERGENCY_STOP.trigger("a test")
        if fails:
            error, self.error = self.error, RuntimeError("and again")
            raise error
        return super().send(action)

    def halt(self):
        self.halted.append(len(self.commands))


def test_nothing_moves_while_the_emergency_stop_is_triggered(twin):
    robot, sent = SimulatedRobot(twin), []
    robot.send = sent.append
    EMERGENCY_STOP.trigger("a test")
    with pytest.raises(EmergencyStopError):
        check_robot(robot)
    assert sent == []


@pytest.mark.parametrize("after", range(1, 14))
def test_an_emergency_stop_ends_the_check_at_once(twin, after):
    robot = _FailsOnItsWay(twin)
    robot.stop_at = after
    with pytest.raises(EmergencyStopError):
        check_robot(robot)
    assert robot.halted == [after]
    assert (len(robot.commands), robot.closed) == (after, 2)


def _has_returned_within_limits(robot):
    """Whether commands end at rest, without a jump or a sudden reversal."""
    geometry = ArmGeometry.of(robot.arm)
    scale = np.abs(geometry.action_scale)[:, None] / geometry.action_bends[:, None]
    path = np.array(robot.commands[AT_REST - 2 :]) / scale  # [rad]
    changes = np.diff(path, axis=0)
    accelerations = np.diff(changes, axis=0)
    return (
        np.allclose(robot.commands[-1], geometry.action_neutral)
        and np.abs(changes).max() <= geometry.step_limit + 1e-9
        and np.abs(accelerations).max() <= geometry.acceleration_limit + 1e-9
    )


@pytest.fixture
def slow(twin):
    """An arm that takes several steps out and back."""
    return twin.model_copy(update={"step_limit_deg": 0.5})


@pytest.mark.parametrize("number", range(AT_REST + 1, AT_REST + 10))
@pytest.mark.parametrize(
    "error", [RuntimeError("a plug came off"), KeyboardInterrupt()]
)
def test_a_check_that_fails_halfway_out_returns_to_rest(slow, number, error):
    robot = _FailsOnItsWay(slow)
    robot.failures = (number, number + 1, number + 3)
    robot.error = error
    expected = S2C2AError if isinstance(error, Exception) else KeyboardInterrupt
    with pytest.raises(expected):
        check_robot(robot)
    assert _has_returned_within_limits(robot)
    assert robot.closed == 2


def test_the_return_of_a_failed_check_ends_where_the_robot_fails_for_a_second(slow):
    robot = _FailsOnItsWay(slow)
    first = AT_REST + 3
    robot.failures = range(first, 1000)
    with pytest.raises(S2C2AError, match="a plug came off"):
        check_robot(robot)
    assert len(robot.commands) == first + slow.control_rate
    assert robot.closed == 2


def test_an_emergency_stop_after_a_failure_ends_the_return(slow):
    robot = _FailsOnItsWay(slow)
    first = AT_REST + 3
    robot.failures = (first,)
    robot.stop_at = first + 1
    with pytest.raises(EmergencyStopError):
        check_robot(robot)
    assert robot.halted == [first + 1]
