"""Robots and controllers cannot change what the loop remembers; their errors are ours."""

import ctypes
import json
from copy import deepcopy
from pickle import dumps, loads

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from puppets import (  # type: ignore[import-not-found]
    Actor,
    ManualClock,
    Puppet,
)

from s2c2a.errors import (
    ControllerError,
    ReadingError,
    RobotError,
    S2C2AError,
    StrategyError,
)
from s2c2a.goals import Goal
from s2c2a.plugins.immutable import immutable
from s2c2a.runtime import CommandLimits, Loop, StepRequest, build_episode
from s2c2a.runtime.border import named_errors
from s2c2a.runtime.record import OWN_COLUMNS
from s2c2a.spaces import Reading, Sensor, Stage

STEPS = 12


def enlarge(array):
    array *= 1000.0


def shift(array):
    array -= 0.001


def forget(array):
    array[...] = np.nan


CHANGES = (enlarge, shift, forget)


def overwrite(change, array):
    """Change an array in place whatever its flags say, as code in C can."""
    if array.size:
        memory = (ctypes.c_char * array.nbytes).from_address(array.ctypes.data)
        change(np.ndarray(array.shape, array.dtype, memory))


class Vandal(Puppet):
    """Robot that changes its arguments, reuses its buffers and changes them later."""

    def __init__(self, arm, clock, change):
        super().__init__(arm, clock)
        self.change = change
        self.received = []
        self.out = np.zeros(self.geometry.action_neutral.shape)
        self.measured = {"cables": np.zeros_like(self.out), "warmth": np.array(300.0)}
        self.given = Reading(0.0, {})

    def read(self):
        for values in self.measured.values():
            self.change(values)
        reading = super().read()
        self.measured["cables"][...] = reading["cables"]
        self.measured["warmth"][...] = 300.0
        for values in self.given.sensors.values():
            overwrite(self.change, values)
        self.given = Reading(reading.time, self.measured)
        return self.given

    def send(self, action):
        self.change(self.out)
        self.received.append(action.copy())
        self.out[...] = super().send(action)
        self.change(action)
        return self.out


class Scribbler(Actor):
    """Controller that writes into everything that it gets, and reuses its buffers."""

    def __init__(self, arm, change):
        super().__init__(arm)
        self.change = change
        self.out = np.zeros(self.geometry.action_neutral.shape)
        self.telemetry = np.zeros((3, 3))

    def estimate(self, reading, last_command):
        overwrite(self.change, last_command)
        for values in reading.sensors.values():
            overwrite(self.change, values)
        return super().estimate(reading, last_command)

    def plan(self, estimate, goal):
        for values in goal:
            overwrite(self.change, values)
        return super().plan(estimate, goal)

    def act(self, goal, reading):
        self.change(self.out)
        self.out[...] = super().act(goal, reading)
        return self.out

    def sent(self, action):
        overwrite(self.change, action)

    def diagnostics(self):
        self.change(self.telemetry)
        self.telemetry[...] = len(self.steps)
        return {"planned": self.telemetry}


@pytest.mark.parametrize("change", CHANGES)
@settings(max_examples=10, deadline=None)
@given(share=st.floats(-1.0, 1.0))
def test_nothing_outside_changes_limits_or_records(twin, change, share):
    limits = CommandLimits.of(twin)
    episodes = []
    for vandal in (False, True):
        clock = ManualClock()
        robot = Vandal(twin, clock, change if vandal else lambda array: None)
        driver = Scribbler(twin, change if vandal else lambda array: None)
        driver.share = share
        goal = Goal.of(3).with_position([0.1, 0.0, 0.5])
        steps = []

        def recorder(step, steps=steps, change=driver.change):
            steps.append(deepcopy(step))
            for array in (step.action, *step.reading.sensors.values()):
                overwrite(change, array)

        with Loop(robot, driver, clock, on_step=recorder) as loop:
            for _ in range(STEPS):
                loop.tick(StepRequest(goal))
                if vandal:
                    change(robot.out)
        commands = np.array([limits.rest, *robot.received])
        sizes = limits.change_sizes(np.diff(commands, axis=0)) / limits.step_limit
        assert sizes.max() <= 1 + 1e-9
        episodes.append(build_episode(steps, twin))
    honest, hostile = episodes
    assert honest.columns.keys() == hostile.columns.keys()
    for name in honest.columns.keys() - {"tick_time"}:
        np.testing.assert_array_equal(honest.columns[name], hostile.columns[name])


def test_records_and_readings_survive_a_copy_between_processes(loop):
    step = loop.tick(StepRequest())
    for copied in (loads(dumps(step)), deepcopy(step)):
        np.testing.assert_array_equal(copied.action, step.action)
        np.testing.assert_array_equal(copied.reading["cables"], step.reading["cables"])
        assert not copied.reading["cables"].flags.writeable
        with pytest.raises(TypeError):
            copied.reading.sensors["cables"] = 0


@pytest.mark.parametrize(
    "array",
    [np.zeros((0, 3)), np.array(2), np.arange(6.0).reshape(2, 3).T, np.array([None])],
)
def test_an_immutable_array_has_the_same_values(array):
    copied = immutable(array)
    np.testing.assert_array_equal(copied, array)
    assert (copied.shape, copied.dtype) == (array.shape, array.dtype)
    assert not copied.flags.writeable


@pytest.mark.parametrize(
    "method", ["start", "estimate", "plan", "act", "sent", "diagnostics"]
)
@pytest.mark.parametrize("error", [OSError("torn"), StopIteration(), KeyError("x")])
def test_an_exception_of_a_controller_names_it_its_method_and_the_step(
    loop, actor, method, error
):
    def fail(*_):
        raise error

    setattr(actor, method, fail)
    expected = rf"Actor\.{method} failed in step 0: {type(error).__name__}"
    with pytest.raises(ControllerError, match=expected) as caught:
        loop.tick(StepRequest())
    assert caught.value.__cause__ is error
    assert loop.phase.stage is Stage.FAULT


@pytest.mark.parametrize(
    ("method", "answer"),
    [
        ("act", None),
        ("act", "nonsense"),
        ("act", [[1.0], [1.0, 2.0]]),
        ("diagnostics", None),
        ("diagnostics", {"ragged": [[1.0], [1.0, 2.0]]}),
    ],
)
def test_an_answer_of_a_controller_without_sense_is_an_error_of_it(
    loop, actor, method, answer
):
    setattr(actor, method, lambda *_: answer)
    with pytest.raises(ControllerError, match=rf"Actor.*{method}|{method}.*Actor"):
        loop.tick(StepRequest())


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_commands_that_are_nan_or_infinite_warn_and_send_numbers(loop, actor, value):
    shape = actor.geometry.action_neutral.shape
    actor.act = lambda *_: np.full(shape, value)
    with pytest.warns(UserWarning, match="Actor returns values that are NaN or inf"):
        step = loop.tick(StepRequest())
    assert step.fault == ""
    assert np.isfinite(step.action).all()


@pytest.mark.parametrize("time", [None, "now", [1.0, 2.0], 1j])
def test_a_reading_whose_time_is_no_number_is_an_error_of_the_robot(loop, puppet, time):
    cables = puppet.position
    puppet.read = lambda: Reading(time, {"cables": cables})
    with pytest.raises(RobotError, match=r"Puppet\.read failed in step 0: the time"):
        loop.tick(StepRequest())


@pytest.mark.parametrize("method", ["open", "send", "advance", "close"])
def test_an_exception_of_a_robot_names_it_and_its_method(puppet, actor, clock, method):
    def fail(*_):
        raise OSError("torn")

    setattr(puppet, method, fail)
    with (
        pytest.raises(RobotError, match=rf"Puppet\.{method} failed"),
        Loop(puppet, actor, clock) as loop,
    ):
        loop.tick(StepRequest())


def test_cables_that_are_no_numbers_are_a_fault_of_the_reading(loop, puppet, clock):
    def read():
        cables = np.full(puppet.position.shape, None)
        return Reading(clock.now(), {"cables": cables, "camera_positions": "none"})

    puppet.read = read
    step = loop.tick(StepRequest())
    assert step.fault == "'cables' is not an array of numbers"
    build_episode([step], puppet.arm)


def test_a_controller_without_a_name_is_recorded_by_its_class(loop, actor):
    assert loop.driver_name == "Actor"
    actor.name = "mine"
    assert loop.driver_name == "mine"


def test_a_controller_whose_arm_has_no_modules_is_refused(puppet, actor, clock):
    actor.arm = None
    with pytest.raises(S2C2AError, match=r"Actor\.arm"):
        Loop(puppet, actor, clock)


def test_a_time_that_the_robot_counts_in_place_does_not_change_readings(loop, puppet):
    clock = np.zeros(())
    read = puppet.read

    def count():
        clock[...] = read().time
        return Reading(clock, {"cables": puppet.position + 1e-9 * puppet.reads})

    puppet.read = count
    steps = [loop.tick(StepRequest()) for _ in range(4)]
    assert [step.fault for step in steps] == [""] * 4
    np.testing.assert_allclose(
        [step.reading.time for step in steps], 0.1 * np.arange(4)
    )


@pytest.mark.parametrize("change", CHANGES)
def test_a_goal_that_its_owner_or_the_controller_changes_stays_in_the_record(
    loop, actor, change
):
    goal = Goal.of(3)._replace(
        positions=np.full((3, 3), 0.2), position_weights=np.ones(3)
    )
    actor.plan = lambda estimate, given: [overwrite(change, array) for array in given]
    actor.act = lambda *_: actor.geometry.action_neutral
    step = loop.tick(StepRequest(goal))
    change(goal.positions)
    np.testing.assert_array_equal(step.goal.positions, np.full((3, 3), 0.2))


def test_nested_values_of_a_reading_are_no_longer_those_of_the_robot():
    kept = [1.0]
    reading = Reading(0.0, {"pair": (kept,), "list": [kept], "set": {1.0}})
    kept[0] = 2.0
    assert reading["pair"] == ([1.0],)
    assert reading["list"] == [[1.0]]


def test_a_robot_that_changes_its_declared_range_does_not_change_the_check(
    puppet, actor, clock
):
    high = np.full((3, 3), 1.0)
    declared = {"cables": Sensor((3, 3), "m", -1.0, high)}
    puppet.__class__ = type("Declaring", (Puppet,), {"sensors": declared})
    with Loop(puppet, actor, clock) as loop:
        high[...] = -5.0
        assert not loop.tick(StepRequest()).fault


@pytest.mark.parametrize(
    "limits",
    [
        {"low": np.zeros(5)},
        {"high": None},
        {"high": "1"},
        {"fastest": np.ones((2, 3, 3))},
    ],
)
def test_a_limit_of_a_sensor_that_fits_no_value_is_refused(limits):
    with pytest.raises(ReadingError, match=r"of a sensor of shape \(3, 3\)"):
        Sensor((3, 3), "m", **limits)


def test_the_shape_of_a_sensor_may_be_a_list():
    assert Sensor([3, 3], "m").shape == (3, 3)


@pytest.mark.parametrize("declared", [None, 3, (3, 3), "cables"])
def test_a_declared_sensor_that_is_none_is_an_error_of_the_robot(
    puppet, actor, clock, declared
):
    kind = type("Declaring", (Puppet,), {"sensors": {"cables": declared}})
    puppet.__class__ = kind
    with pytest.raises(RobotError, match=r"Declaring\.sensors.*not a Sensor"):
        Loop(puppet, actor, clock)


@pytest.mark.parametrize("name", [*sorted(OWN_COLUMNS), "sensor.cables", 3, None])
def test_telemetry_in_place_of_what_the_loop_records_is_refused(loop, actor, name):
    actor.diagnostics = lambda: {name: np.array(7.0)}
    with pytest.raises(ControllerError, match=r"Actor\.diagnostics .*is no name"):
        loop.tick(StepRequest())


@pytest.mark.parametrize("name", ["name", "sensors", "act", "set_real_time"])
def test_a_property_of_a_controller_that_fails_is_an_error_of_it(
    puppet, actor, clock, name
):
    kind = type("Torn", (Actor,), {name: property(lambda self: 1 / 0)})
    actor.__class__ = kind
    with pytest.raises(ControllerError, match=rf"Torn\.{name} failed"):
        _ = Loop(puppet, actor, clock).driver_name


@pytest.mark.parametrize("name", ["arm", "own_time", "sensors"])
def test_a_property_of_a_robot_that_fails_is_an_error_of_it(puppet, actor, clock, name):
    torn = property(lambda self: 1 / 0, lambda self, value: None)
    puppet.__class__ = type("Torn", (Puppet,), {name: torn})
    with pytest.raises(RobotError, match=rf"Torn\.{name} failed"):
        Loop(puppet, actor, clock)


@pytest.mark.parametrize("cables", [None, np.array(0.5), np.zeros(9), "none"])
def test_cables_of_another_shape_in_every_step_are_recorded_as_missing(
    loop, puppet, clock, cables
):
    puppet.read = lambda: Reading(clock.now(), {"cables": cables})
    steps = [loop.tick(StepRequest()) for _ in range(3)]
    recorded = build_episode(steps, puppet.arm).sensor("cables")
    assert recorded.shape == (3, 3, 3)
    assert np.isnan(recorded).all()


def fail_in_a_library():
    json.loads("{")


def test_an_error_names_the_line_of_the_users_code_that_led_to_it():
    line = fail_in_a_library.__code__.co_firstlineno + 1
    expected = rf"mine failed: JSONDecodeError: .* \(test_borders\.py, line {line}\)$"
    with (
        pytest.raises(StrategyError, match=expected),
        named_errors(StrategyError, "mine failed"),
    ):
        fail_in_a_library()
