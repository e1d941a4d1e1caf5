"""The robot above a servo bus: limits of commands, faults, halt and close."""

from dataclasses import replace

import numpy as np
import pytest
from fake_servo_bus import FakeServoBus
from homes import arm_with_servos, calibration_with
from hypothesis import given, settings
from hypothesis import strategies as st
from servos_in_memory import Clock

from s2c2a.arm import ArmGeometry
from s2c2a.errors import ActionError, RobotError
from s2c2a.lab.hardware.bus import BusError, HardwareError
from s2c2a.lab.hardware.calibration import save_calibration
from s2c2a.lab.hardware.servo_robot import DynamixelRobot
from s2c2a.lab.hardware.winch import Winches
from s2c2a.runtime.emergency import EmergencyStop, EmergencyStopError

IDS = list(range(1, 10))
HOME = 1000  # ticks


class Bench:
    """A robot over a fake bus."""

    def __init__(self, folder, arm, patch):
        self.arm = arm
        self.clock = Clock()
        self.bus = FakeServoBus(IDS, self.clock)
        for id, state in self.bus.states.items():
            self.bus.states[id] = replace(state, position=HOME)
        for name in ("servo_robot", "motion_watch"):
            patch.setattr(f"s2c2a.lab.hardware.{name}.time", self.clock)
        patch.setattr("s2c2a.lab.hardware.servo_robot.open_bus", lambda *_: self.bus)
        path = folder / "calibration.json"
        save_calibration(calibration_with(arm, dict.fromkeys(IDS, HOME)), path)
        self.robot = DynamixelRobot(arm, "fake", str(path))

    @property
    def commands(self):
        """Times [s] and displacements [m] on the wire, shape (times, cables)."""
        winches = Winches.of(self.arm, np.full((3, 3), HOME))
        times = np.array([time for time, _ in self.bus.goals])
        ticks = [[goals[id] for id in IDS] for _, goals in self.bus.goals]
        rows = [winches.displacements(np.reshape(row, (3, 3))).ravel() for row in ticks]
        return times, np.array(rows)


@pytest.fixture
def make_bench(tmp_path, monkeypatch):
    def make(**servos):
        return Bench(tmp_path, arm_with_servos(**servos), monkeypatch)

    return make


@pytest.fixture
def bench(make_bench):
    bench = make_bench()
    bench.robot.open()
    return bench


VALUES = st.one_of(st.floats(-0.1, 0.1), st.floats(-1e6, 1e6))
ACTIONS = st.lists(VALUES, min_size=9, max_size=9).map(
    lambda row: np.reshape(row, (3, 3))
)
PAUSES = st.floats(0.0, 0.5)  # s
LIMITS = st.fixed_dictionaries(
    {
        "displacement": st.floats(0.001, 0.1),
        "speed": st.floats(0.005, 1.0),
        "current": st.floats(0.1, 1.5),
    }
)


@settings(max_examples=60, deadline=None)
@given(LIMITS, st.lists(st.tuples(PAUSES, ACTIONS), min_size=1, max_size=25))
def test_no_command_on_the_wire_exceeds_a_limit(tmp_path_factory, limits, steps):
    arm = arm_with_servos(limits=limits)
    with pytest.MonkeyPatch.context() as patch:
        bench = Bench(tmp_path_factory.mktemp("limits"), arm, patch)
        bench.robot.open()
        for pause, action in steps:
            bench.clock.sleep(pause)
            bench.robot.send(action)
    times, commands = bench.commands
    tick = 2 * np.pi * arm.motor.pulley_radius / 4096
    largest = min(limits["displacement"], ArmGeometry.of(arm).action_high.max())
    assert np.abs(commands).max() <= largest + tick / 2
    travel = np.cumsum(np.abs(np.diff(commands, axis=0)), axis=0)
    allowance = limits["speed"] * (times[1:] - times[0])
    # from any command to any later one: two periods in advance, and rounding
    ahead = travel - allowance[:, None]
    excess = ahead - np.minimum.accumulate(ahead, axis=0)
    assert excess.max() <= 2 * limits["speed"] * arm.control_period + 2 * tick
    assert max(bench.bus.currents) <= limits["current"]
    assert [speed for _, speed in bench.bus.prepared] == [
        pytest.approx(limits["speed"] / arm.motor.pulley_radius)
    ]


def test_what_is_returned_is_what_was_sent(bench):
    bench.clock.sleep(0.1)
    sent = bench.robot.send(np.full((3, 3), 0.5))
    _, commands = bench.commands
    np.testing.assert_allclose(sent.ravel(), commands[-1])


@pytest.mark.parametrize(
    "action", [np.zeros(9), np.full((3, 3), np.nan), np.full((3, 3), np.inf), "up"]
)
def test_an_impossible_action_reaches_no_servo(bench, action):
    count = len(bench.bus.goals)
    with pytest.raises(ActionError):
        bench.robot.send(action)
    assert len(bench.bus.goals) == count


def test_the_robot_opens_with_torque_and_watchdog(bench):
    assert bench.bus.torques == dict.fromkeys(IDS, True)
    assert bench.bus.watchdogs == dict.fromkeys(IDS, 0.4)
    assert bench.robot.read().fault == ""


def test_a_silent_servo_has_no_measurement_and_a_fault(bench):
    del bench.bus.states[5]
    reading = bench.robot.read()
    assert np.isnan(reading["cables"]).sum() == 1
    assert np.isnan(reading["cables"][1, 1])
    assert "servo 5 (module 2, cable 2) does not answer" in reading.fault


def test_a_lost_port_is_a_fault_of_the_reading(bench):
    bench.bus.lost = True
    reading = bench.robot.read()
    assert np.isnan(reading["cables"]).all()
    assert "plug it in again" in reading.fault


def test_servos_that_stopped_by_their_watchdog_obey_again(bench):
    bench.bus.states[5] = replace(bench.bus.states[5], watchdog_tripped=True)
    assert "stopped by itself" in bench.robot.read().fault
    assert bench.robot.read().fault == ""
    assert bench.bus.watchdogs == dict.fromkeys(IDS, 0.4)


def test_a_sound_robot_that_is_opened_again_keeps_its_torque(bench):
    bench.robot.open()
    assert len(bench.bus.prepared) == 1


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"errors": frozenset([HardwareError.OVERLOAD])}, "overloaded"),
        ({"temperature": 90.0}, "90 deg C"),
        ({"voltage": 3.0}, "3.0 V"),
    ],
)
def test_an_arm_with_a_faulty_servo_does_not_open(make_bench, change, text):
    bench = make_bench()
    bench.bus.states[5] = replace(bench.bus.states[5], **change)
    with pytest.raises(RobotError, match=text):
        bench.robot.open()
    assert not any(bench.bus.torques.values())
    assert not bench.bus.is_open


def test_an_arm_out_of_its_range_does_not_open(make_bench):
    bench = make_bench(limits={"displacement": 0.01})
    state = bench.bus.states[5]
    bench.bus.states[5] = replace(state, position=HOME + 2000)
    with pytest.raises(RobotError, match=r"servos \[5\] stand at \[30\.7\] mm"):
        bench.robot.open()
    assert bench.bus.goals == []


def test_turns_that_servos_forgot_do_not_move_the_arm(make_bench):
    bench = make_bench()
    bench.bus.states[5] = replace(bench.bus.states[5], position=HOME - 3 * 4096)
    bench.robot.open()
    assert bench.bus.states[5].position == HOME - 3 * 4096


def test_cables_of_more_than_a_turn_are_announced(tmp_path, monkeypatch):
    arm = arm_with_servos()
    motor = arm.motor.model_copy(update={"pulley_radius": 0.006})
    bench = Bench(tmp_path, arm.model_copy(update={"motor": motor}), monkeypatch)
    with pytest.warns(UserWarning, match="home the arm again after every loss"):
        bench.robot.open()


def test_a_missing_servo_is_named_when_the_robot_opens(make_bench):
    bench = make_bench()
    del bench.bus.states[5]
    with pytest.raises(BusError, match=r"servo 5 \(module 2, cable 2\)"):
        bench.robot.open()


@pytest.mark.parametrize(("choice", "torque"), [("hold", True), ("release", False)])
def test_a_halt_stops_where_the_arm_is_and_closing_does_not_undo_it(
    make_bench, choice, torque
):
    bench = make_bench(on_emergency=choice, on_exit="release")
    bench.robot.open()
    bench.bus.states[5] = replace(bench.bus.states[5], position=HOME + 123)
    bench.robot.halt()
    _, goals = bench.bus.goals[-1]
    assert goals[5] == HOME + 123
    assert bench.bus.torques == dict.fromkeys(IDS, torque)
    bench.robot.close()
    assert bench.bus.torques == dict.fromkeys(IDS, torque)


def test_an_emergency_stop_ends_the_way_to_rest_of_an_arm_that_opens(
    make_bench, monkeypatch
):
    bench = make_bench(on_emergency="hold")
    bench.bus.states[5] = replace(bench.bus.states[5], position=HOME + 500)
    stop = EmergencyStop()
    monkeypatch.setattr("s2c2a.lab.hardware.motion_watch.EMERGENCY_STOP", stop)
    started = bench.clock.now
    sleep = bench.clock.sleep

    def sleep_and_stop(seconds):
        sleep(seconds)
        if bench.clock.now > started + 0.1:
            stop.trigger()

    bench.clock.sleep = sleep_and_stop
    with pytest.raises(EmergencyStopError):
        bench.robot.open()
    assert bench.clock.now < started + 0.2
    assert HOME < bench.bus.states[5].position < HOME + 500
    bench.robot.close()
    assert bench.bus.torques == dict.fromkeys(IDS, True)


def test_the_way_to_rest_is_within_rate_and_acceleration(make_bench):
    bench = make_bench(limits={"speed": 5.0})
    bench.bus.states[5] = replace(bench.bus.states[5], position=HOME + 1500)
    bench.robot.open()
    times, commands = bench.commands
    times, commands = times[1:], commands[1:]  # the first one holds the arm
    arm, geometry = bench.arm, ArmGeometry.of(bench.arm)
    radius, period = geometry.cable_radii.min(), arm.control_period
    tick = 2 * np.pi * arm.motor.pulley_radius / 4096
    # over a control period, where rounding to ticks hardly counts
    changes = commands[5:] - commands[:-5]
    assert np.allclose(times[5:] - times[:-5], period)
    assert np.abs(changes).max() <= radius * geometry.step_limit + tick
    accelerations = changes[5:] - changes[:-5]
    allowed = radius * geometry.acceleration_limit + 2 * tick
    assert np.abs(accelerations).max() <= allowed
    assert np.abs(commands[0] - commands[1]).max() <= 2 * tick


@pytest.fixture
def bent(make_bench):
    """A robot whose arm is bent, before it opens."""
    bench = make_bench()
    bench.bus.states[5] = replace(bench.bus.states[5], position=HOME + 1000)
    return bench


def test_a_way_to_rest_that_takes_too_long_ends_with_an_error(bent):
    read = bent.bus.read_states
    bent.bus.read_states = lambda ids: bent.clock.sleep(0.9) or read(ids)
    with pytest.raises(RobotError, match="answer too slowly"):
        bent.robot.open()
    assert bent.clock.now < 130.0
    assert HOME < bent.bus.states[5].position < HOME + 1000


def test_a_way_to_rest_ends_where_the_program_stood_still(bent, monkeypatch):
    monkeypatch.setattr(
        "s2c2a.lab.hardware.motion_watch.time_with_sleep",
        lambda: bent.clock.now + (30.0 if bent.clock.now > 100.5 else 0.0),
    )
    with pytest.raises(RobotError, match=r"stood still for 30\.\d s"):
        bent.robot.open()
    assert HOME < bent.bus.states[5].position < HOME + 1000


def test_a_halted_robot_is_prepared_when_it_opens_again(bench):
    bench.robot.halt()
    bench.robot.open()
    assert len(bench.bus.prepared) == 2
    assert all(bench.bus.torques.values())


def test_all_servos_are_released_at_the_end_although_one_is_silent(bench):
    del bench.bus.states[5]
    bench.robot.close()
    bench.robot.close()
    assert bench.bus.torques == dict.fromkeys(IDS, False)
    assert not bench.bus.is_open


def test_a_robot_that_holds_at_the_end_keeps_its_watchdog(make_bench):
    bench = make_bench(on_exit="hold")
    bench.robot.open()
    bench.robot.close()
    assert bench.bus.torques == dict.fromkeys(IDS, True)
    assert bench.bus.watchdogs == dict.fromkeys(IDS, 0.4)


def test_servos_without_a_watchdog_are_announced(make_bench, monkeypatch):
    monkeypatch.setattr(FakeServoBus, "has_watchdog", False)
    bench = make_bench()
    with pytest.warns(UserWarning, match="no watchdog"):
        bench.robot.open()
    bench.robot.close()
    assert bench.bus.watchdogs == {}
