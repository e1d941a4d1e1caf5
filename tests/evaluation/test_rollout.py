"""Rollouts with a robot and a strategy that number their steps."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.errors import RecordingError, S2C2AError, SimulationError
from s2c2a.evaluation import position_errors, rollout, score_run
from s2c2a.goals import Goal
from s2c2a.robots import Robot, checked_action
from s2c2a.runtime import StepClock
from s2c2a.runtime.operator import OPERATOR
from s2c2a.spaces import Reading, Sensor, Stage
from s2c2a.tasks import Task

STEPS = 5


class Counter(Robot):
    """Robot whose tip has the height n after n actions; it records all calls."""

    own_time = True

    def __init__(self, arm):
        self.arm = arm
        self.geometry = ArmGeometry.of(arm)
        self.sent = []
        self.closed = 0
        self.invalid = range(0)

    @property
    def sensors(self):
        modules, cables = self.arm.module_count, self.arm.cable_count
        return {
            "cables": Sensor((modules, cables), "m", -50.0, 50.0),
            "states": Sensor((modules, 6), "m, 1"),
        }

    def open(self):
        self.sent = []
        return self.read()

    def read(self):
        number = len(self.sent)
        states = np.zeros((self.arm.module_count, 6))
        states[-1, 2] = number
        away = np.nan if number in self.invalid else 1e-5 * number
        cables = self.geometry.action_neutral + away
        return Reading(0.1 * number, {"cables": cables, "states": states})

    def send(self, action):
        self.sent.append(checked_action(action, self.geometry))
        return self.sent[-1]

    def close(self):
        self.closed += 1


def turns_deg(robot, actions) -> np.ndarray:
    """Turns of the motors between actions [deg]."""
    moved = np.abs(np.diff(actions, axis=0)) / robot.geometry.cable_radii[:, None]
    return np.rad2deg(moved)


class Script:
    """Strategy whose actions grow steadily, then by far too much; it records inputs."""

    name = "script"
    sensors = ("cables",)

    def __init__(self, arm):
        self.arm = arm
        self.geometry = ArmGeometry.of(arm)
        self.starts = []
        self.inputs = []
        self.limited = []

    def start(self, reading):
        self.starts.append(reading)

    def estimate(self, reading, last_command):
        return reading

    def plan(self, estimate, goal):
        return goal

    def act(self, goal, reading):
        self.inputs.append((reading, goal))
        share = 0.05 * len(self.inputs) if len(self.inputs) < STEPS else 9.0
        return self.geometry.action_neutral + share * (
            self.geometry.action_high - self.geometry.action_neutral
        )

    def sent(self, action):
        self.limited.append(action)

    def diagnostics(self):
        number = len(self.inputs)
        states = np.full((3, 6), 400.0 + number)
        return {
            "sensed": np.full((3, 3), 200.0 + number),
            "planned": np.full((3, 3), 300.0 + number),
            "predicted": states,
        }


@pytest.fixture
def task():
    """Targets at the heights of the robot's tip after each action."""
    rest = Goal.of(3)
    return Task(
        "count", tuple(rest.with_position([0, 0, step + 1.0]) for step in range(STEPS))
    )


@pytest.fixture
def robot(twin):
    return Counter(twin)


@pytest.fixture
def script(twin):
    return Script(twin)


@pytest.fixture
def run(robot, script, task):
    """Episode of the rollout."""
    return rollout(robot, script, task)


def test_the_episode_has_columns_of_readings_actions_diagnostics_and_goals(run):
    assert run.options == {"strategy": "script", "task": "count", "late_steps": 0}
    assert {name: values.shape[1:] for name, values in run.columns.items()} == {
        "time": (),
        "stage": (),
        "tick_time": (),
        "actions": (3, 3),
        "sensor.cables": (3, 3),
        "sensor.states": (3, 6),
        "sensed": (3, 3),
        "planned": (3, 3),
        "predicted": (3, 6),
        "desired_positions": (3, 3),
    }


def test_the_target_of_a_step_is_compared_with_the_state_after_its_action(run, task):
    np.testing.assert_array_equal(run.after("states")[:, -1, 2], [1, 2, 3, 4, 5])
    np.testing.assert_array_equal(
        run.ran("desired_positions")[:, -1, 2], [1, 2, 3, 4, 5]
    )
    np.testing.assert_array_equal(
        position_errors(run.after("states"), task.desired_positions()), 0
    )
    assert score_run(run, task, "paper")[0].value == 0.0


def test_the_strategy_gets_the_reading_before_its_action_and_the_goal_of_the_step(
    run, script, task
):
    assert [reading["states"][-1, 2] for reading, _ in script.inputs] == [0, 1, 2, 3, 4]
    goals = [goal for _, goal in script.inputs]
    assert len(goals) == STEPS
    unknown = task.goals[0].preview
    for goal, desired in zip(goals, task.goals, strict=True):
        for one, other in zip(goal._replace(preview=unknown), desired, strict=True):
            np.testing.assert_array_equal(one, other)
    # the last goal lasts
    np.testing.assert_array_equal(
        goals[0].preview[STEPS:, -1, :3],
        goals[-1].positions[-1:].repeat(len(unknown) - STEPS, 0),
    )
    assert [reading.time for reading in script.starts] == [0.0]


def test_actions_are_the_sent_ones_within_the_step_limit(run, robot, script, twin):
    """0.05 of the range a step is allowed; the last step is limited to 4 deg."""
    high = ArmGeometry.of(twin).action_high
    np.testing.assert_allclose(
        run.ran("actions")[:4], [share * high for share in (0.05, 0.1, 0.15, 0.2)]
    )
    turns = turns_deg(robot, [robot.geometry.action_neutral, *robot.sent])
    assert turns.max() == pytest.approx(twin.step_limit_deg)
    np.testing.assert_array_equal(script.limited, [run.ran("actions")[4]])


def test_the_return_to_rest_is_in_the_episode_within_the_step_limit(run, robot, twin):
    """One step more than the distance takes, to reverse, and one reading at rest."""
    np.testing.assert_array_equal(run["actions"], robot.sent)
    actions_to_rest = np.array(robot.sent[STEPS - 1 :])
    np.testing.assert_allclose(
        actions_to_rest[-1], robot.geometry.action_neutral, atol=1e-15
    )
    assert turns_deg(robot, actions_to_rest).max() <= twin.step_limit_deg + 1e-9
    bent = turns_deg(robot, actions_to_rest[[0, -1]]).max()
    assert len(actions_to_rest) - 1 == np.ceil(bent / twin.step_limit_deg) + 1
    assert list(run["stage"]) == [Stage.RUN] * STEPS + [Stage.RELEASE] * (
        len(actions_to_rest) - 2
    ) + [Stage.IDLE]


def test_a_task_that_ends_at_rest_has_a_reading_after_its_last_action(
    robot, script, twin
):
    script.step = lambda reading, goal: script.geometry.action_neutral
    steps = []
    task = Task("rest", (Goal.of(3),) * 3)
    run = rollout(robot, script, task, on_step=steps.append)
    assert len(steps) == len(run)
    assert len(run.after("states")) == 3


def test_a_run_without_true_states_is_recorded_and_cannot_be_scored(
    robot, script, task, monkeypatch
):
    monkeypatch.setattr(
        robot,
        "read",
        lambda: Reading(0.1 * len(robot.sent), {"cables": np.zeros((3, 3))}),
    )
    run = rollout(robot, script, task)
    with pytest.raises(S2C2AError, match="no true states"):
        score_run(run, task, "paper")
    with pytest.raises(RecordingError, match=r"sensor\.states"):
        run.after("states")


def test_the_arm_holds_while_a_sensor_fails_for_a_moment(robot, script, task):
    robot.invalid = range(2, 3)
    run = rollout(robot, script, task)
    assert list(run["stage"][:STEPS]) == [
        Stage.RUN,
        Stage.RUN,
        Stage.HOLD,
        Stage.RUN,
        Stage.RUN,
    ]
    assert run.options["faults"] == ["'cables' is not finite"]
    np.testing.assert_array_equal(run["actions"][2], run["actions"][1])
    assert len(run.after("states")) == STEPS


def test_a_sensor_that_fails_for_long_ends_the_run_with_the_arm_at_rest(robot, script):
    task = Task("long", (Goal.of(3),) * 60)
    robot.invalid = range(4, 100)
    with pytest.raises(
        S2C2AError,
        match=r"step 15 of 'long': 'cables' is not finite; the arm was moved to rest",
    ):
        rollout(robot, script, task)
    np.testing.assert_allclose(
        robot.sent[-1], robot.geometry.action_neutral, atol=1e-15
    )
    assert turns_deg(robot, robot.sent).max() <= robot.arm.step_limit_deg + 1e-9
    assert robot.closed == 1


def test_a_sensor_that_never_works_keeps_the_arm_at_rest(robot, script, task):
    robot.invalid = range(100)
    with pytest.raises(S2C2AError, match=r"step 1 of 'count': 'cables' is not finite"):
        rollout(robot, script, task)
    np.testing.assert_array_equal(
        robot.sent, [robot.geometry.action_neutral] * len(robot.sent)
    )


def test_an_error_closes_the_robot_and_is_raised(robot, script, task, monkeypatch):
    def fail(action):
        raise SimulationError("gone", step=1)

    monkeypatch.setattr(robot, "send", fail)
    with pytest.raises(SimulationError, match="gone"):
        rollout(robot, script, task)
    assert robot.closed == 1


def test_a_tension_arm_returns_to_its_pretension(simulated):
    robot, script = Counter(simulated), Script(simulated)
    script.diagnostics = dict
    task = Task("rest", (Goal.of(3),) * STEPS)
    rollout(robot, script, task)
    np.testing.assert_allclose(
        robot.sent[-1], robot.geometry.action_neutral, rtol=1e-12
    )
    assert robot.sent[-1].min() > 0


def test_an_interrupted_run_hands_over_its_steps(robot, script, task):
    kept = []
    told = []

    def fail(done, total):
        told.append((done, total))
        if done == 3:
            raise S2C2AError("no power")

    with pytest.raises(S2C2AError, match="no power"):
        rollout(robot, script, task, fail, keep=kept.append)
    (episode,) = kept
    assert told == [(1, STEPS), (2, STEPS), (3, STEPS)]
    assert len(episode.columns["time"]) == 3
    assert episode.options["interrupted"] == "no power"


class Sleeper(StepClock):
    """A clock on which the computer sleeps once, in the third step."""

    slept = 0.0

    def with_sleep(self):
        return self.now() + self.slept

    def wait_until(self, moment):
        super().wait_until(moment)
        if moment > 0.25:
            self.slept = 600.0


class RealCounter(Counter):
    """The same in real time; it keeps its cables where they are."""

    own_time = False

    def __init__(self, arm, clock):
        super().__init__(arm)
        self.clock = clock

    def read(self):
        self.number = getattr(self, "number", 0) + 1
        reading = super().read()
        cables = np.full(self.geometry.action_neutral.shape, 1e-5 * self.number)
        sensors = {**reading.sensors, "cables": cables}
        return replace(reading, time=self.clock.now() + 1e-6, sensors=sensors)


@pytest.fixture
def counting(twin, task):
    """A robot in real time, a strategy, a task and a clock."""
    clock = Sleeper()
    return RealCounter(twin, clock), Script(twin), task, clock


@pytest.fixture
def operator():
    """The operator of this process, absent afterwards."""
    yield OPERATOR
    OPERATOR.attends = False


def test_without_an_operator_a_run_ends_at_rest_after_a_standstill(counting):
    robot, strategy, task, clock = counting
    with pytest.raises(
        S2C2AError, match=r"stood still for 600\.\d s; the arm was moved"
    ):
        rollout(robot, strategy, task, clock=clock)
    assert robot.closed


def test_an_operator_who_agrees_lets_a_run_go_on(counting, operator, monkeypatch):
    robot, strategy, task, clock = counting
    operator.attends = True
    monkeypatch.setattr(operator, "ask", lambda text: setattr(operator, "agrees", True))
    episode = rollout(robot, strategy, task, clock=clock)
    # as many as a score of the task needs: the wait is no part of the run
    assert len(episode.running) == STEPS
    assert set(episode.ran("stage")) == {Stage.RUN}
    assert "stood still for 600" in str(episode.options["faults"])


def test_an_operator_who_does_not_answer_ends_a_run_at_rest(counting, operator):
    robot, strategy, task, clock = counting
    operator.attends = True
    with pytest.raises(S2C2AError, match="stood still"):
        rollout(robot, strategy, task, clock=clock)
    assert clock.now() == pytest.approx(10.5, abs=1.0)
