"""A run step by step, with a robot and a strategy whose every number tells when it was made."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.errors import S2C2AError, SimulationError
from s2c2a.evaluation import position_errors, rollout
from s2c2a.planning import Goal
from s2c2a.robots import Robot, checked_action
from s2c2a.spaces import Reading
from s2c2a.tasks import Task

STEPS = 5


class Counter(Robot):
    """A robot whose tip stands at height n after n actions; it notes what it is sent and when it is closed."""

    def __init__(self, arm):
        self.arm = arm
        self.geometry = ArmGeometry.of(arm)
        self.sent, self.closed = [], 0

    def open(self):
        self.sent = []
        return self.read()

    def read(self):
        states = np.zeros((self.arm.module_count, 6))
        states[-1, 2] = len(self.sent)
        shapes = np.full((self.arm.module_count, 3), 100.0 + len(self.sent))
        return Reading(0.1 * len(self.sent), np.full((3, 3), float(len(self.sent))), states, shapes)

    def send(self, action):
        self.sent.append(checked_action(action, self.geometry))
        return self.sent[-1]

    def close(self):
        self.closed += 1


class Script:
    """A strategy that asks for too much and notes what it was given."""

    name = "script"

    def __init__(self, arm):
        self.geometry = ArmGeometry.of(arm)
        self.began, self.seen = [], []

    def start(self, reading):
        self.began.append(reading)

    def step(self, reading, goal):
        self.seen.append((reading, goal))
        return self.geometry.action_high * (0.1 * len(self.seen) if len(self.seen) < STEPS else 9.0)

    @property
    def sensed(self):
        return np.full((3, 3), 200.0 + len(self.seen))

    @property
    def planned(self):
        return np.full((3, 3), 300.0 + len(self.seen))


@pytest.fixture
def task():
    """Heights 1, 2, 3 ... for the tip: where the counter's tip is after each action."""
    rest = Goal.of(3)
    return Task("count", tuple(rest.with_position([0, 0, step + 1.0]) for step in range(STEPS)))


@pytest.fixture
def robot(twin):
    return Counter(twin)


@pytest.fixture
def script(twin):
    return Script(twin)


@pytest.fixture
def run(robot, script, task):
    """The whole run."""
    return rollout(robot, script, task)


def test_every_array_has_one_row_a_step(run, task):
    assert (run.task, run.strategy) == (task, "script")
    shapes = {
        "times": (), "states": (3, 6), "configurations": (3, 3), "sensed": (3, 3), "planned": (3, 3),
        "actions": (3, 3), "tick_times": (),
    }  # fmt: skip
    assert {name: getattr(run, name).shape for name in shapes} == {n: (STEPS, *s) for n, s in shapes.items()}


def test_the_target_of_a_step_is_compared_with_the_state_after_its_action(run):
    np.testing.assert_array_equal(run.states[:, -1, 2], [1, 2, 3, 4, 5])
    np.testing.assert_array_equal(run.task.wanted_positions()[:, -1, 2], [1, 2, 3, 4, 5])
    np.testing.assert_array_equal(position_errors(run.states, run.task.wanted_positions()), 0)


def test_times_and_true_configurations_are_those_after_the_action(run):
    np.testing.assert_allclose(run.times, [0.1, 0.2, 0.3, 0.4, 0.5])
    np.testing.assert_array_equal(run.configurations[:, 0, 0], [101, 102, 103, 104, 105])


def test_sensed_and_planned_are_those_of_the_step(run):
    np.testing.assert_array_equal(run.sensed[:, 0, 0], [201, 202, 203, 204, 205])
    np.testing.assert_array_equal(run.planned[:, 0, 0], [301, 302, 303, 304, 305])


def test_the_strategy_sees_the_reading_before_its_action_and_the_goal_of_the_step(run, script, task):
    assert [reading.states[-1, 2] for reading, _ in script.seen] == [0, 1, 2, 3, 4]
    assert [goal is wanted for (_, goal), wanted in zip(script.seen, task.goals, strict=True)] == [True] * STEPS
    assert [reading.time for reading in script.began] == [0.0]


def test_actions_are_those_really_sent(run, twin):
    high = ArmGeometry.of(twin).action_high
    np.testing.assert_allclose(run.actions, [share * high for share in (0.1, 0.2, 0.3, 0.4, 1.0)])


def test_thinking_takes_time_and_the_robot_none_of_it(run):
    assert np.all(run.tick_times > 0)
    assert run.tick_times.max() < 0.05


def test_the_arm_is_led_back_to_rest_no_faster_than_its_step_limit(run, robot, twin):
    """In even steps of at most the limit from the last action, full bend, to neutral."""
    way_back = np.array(robot.sent[STEPS - 1 :])
    np.testing.assert_array_equal(way_back[-1], robot.geometry.action_neutral)
    turns = np.abs(np.diff(way_back, axis=0)) / (robot.geometry.cable_radii[:, None])
    assert np.rad2deg(turns.max()) <= twin.step_limit_deg + 1e-9
    assert len(way_back) - 1 == np.ceil(twin.modules[0].bend_limit_deg / twin.step_limit_deg)


def test_the_robot_is_closed_once_at_the_end(run, robot):
    assert robot.closed == 1


def test_progress_counts_the_steps(robot, script, task):
    told = []
    rollout(robot, script, task, progress=lambda done, total: told.append((done, total)))
    assert told == [(step, STEPS) for step in range(1, STEPS + 1)]


def test_a_robot_that_nothing_watches_cannot_be_scored(robot, script, task, monkeypatch):
    blind = replace(robot.read(), states=None, configurations=None)
    monkeypatch.setattr(robot, "read", lambda: blind)
    with pytest.raises(S2C2AError, match="no true states"):
        rollout(robot, script, task)
    assert (robot.sent, robot.closed) == ([], 1)


def test_an_error_on_the_way_closes_the_robot_and_goes_on(robot, script, task, monkeypatch):
    def fail(action):
        raise SimulationError("gone", step=1)

    monkeypatch.setattr(robot, "send", fail)
    with pytest.raises(SimulationError, match="gone"):
        rollout(robot, script, task)
    assert robot.closed == 1


def test_a_tension_arm_is_led_back_to_its_pretension(simulated):
    robot, script = Counter(simulated), Script(simulated)
    task = Task("rest", (Goal.of(3),) * STEPS)
    rollout(robot, script, task)
    np.testing.assert_array_equal(robot.sent[-1], robot.geometry.action_neutral)
    assert robot.sent[-1].min() > 0
