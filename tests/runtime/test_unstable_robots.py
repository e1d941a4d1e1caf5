"""Robots that carry out commands late, or others than were sent."""

from collections import deque

import numpy as np
import pytest
from puppets import Actor, Puppet  # type: ignore[import-not-found]

from s2c2a.arm import ArmGeometry
from s2c2a.errors import RobotError
from s2c2a.planning import PAPER
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime import Loop, Patience, StepRequest
from s2c2a.spaces import POSITION, Stage
from s2c2a.strategies import pcc_strategy, s2c2a_strategy, shipped_networks
from s2c2a.tasks import circle

from marks import slow_after

SECONDS = 12.0
FAULT_TIME = 4.0  # s
LAG = 3  # control steps
NEAR = 0.05  # m
NOTICED = 3.0  # s


class LateRobot(SimulatedRobot):
    """Carries out commands some steps late from a moment on."""

    def open(self):
        self.waiting: deque[np.ndarray] = deque(maxlen=LAG + 1)
        return super().open()

    def send(self, action):
        self.waiting.append(np.asarray(action, float))
        late = self.data.time >= FAULT_TIME
        super().send(self.waiting[0] if late else action)
        return action


class DisproportionateRobot(SimulatedRobot):
    """Moves so many times as far as it says, up to its limits."""

    gain = 4.0

    def send(self, action):
        geometry = ArmGeometry.of(self.arm)
        rest = geometry.action_neutral
        wrong = rest + self.gain * (np.asarray(action) - rest)
        super().send(np.clip(wrong, geometry.action_low, geometry.action_high))
        return action


@pytest.mark.slow
def test_an_arm_whose_robot_lags_by_three_steps_stays_near_its_path(twin):
    strategy = s2c2a_strategy(shipped_networks(twin))
    goals = circle(twin).goals[: round(SECONDS * twin.control_rate)]
    with Loop(LateRobot(twin), strategy) as loop:
        steps = [loop.tick(StepRequest(goal)) for goal in goals]
    tips = np.array([step.reading["states"][-1, POSITION] for step in steps])
    targets = np.array([goal.desired_positions()[-1] for goal in goals])
    errors = np.linalg.norm(tips - targets, axis=-1)
    settled = errors[round(FAULT_TIME * twin.control_rate) :]
    assert settled.max() < NEAR
    assert settled[-20:].mean() < 0.5 * NEAR


@pytest.mark.parametrize("gain", slow_after(1, [4.0, -1.0]))
@pytest.mark.parametrize("name", slow_after(1, ["twin", "simulated"]))
def test_an_arm_that_contradicts_its_commands_is_held_then_moved_to_rest(
    name, gain, request
):
    arm = request.getfixturevalue(name)
    robot = DisproportionateRobot(arm)
    robot.gain = gain
    goals = circle(arm).goals[: round(SECONDS * arm.control_rate)]
    with Loop(robot, pcc_strategy(arm, PAPER)) as loop:
        steps = [loop.tick(StepRequest(goal)) for goal in goals]
    first = next(number for number, step in enumerate(steps) if step.fault)
    assert "the cables do not follow the commands" in steps[first].fault
    assert steps[first].stage is Stage.HOLD
    assert first < NOTICED * arm.control_rate
    assert steps[-1].stage is Stage.FAULT
    np.testing.assert_allclose(steps[-1].action, ArmGeometry.of(arm).action_neutral)


@pytest.mark.slow
def test_a_learned_strategy_is_stopped_on_a_robot_that_moves_four_times_as_far(twin):
    strategy = s2c2a_strategy(shipped_networks(twin))
    goals = circle(twin).goals[: round(SECONDS * twin.control_rate)]
    with Loop(DisproportionateRobot(twin), strategy) as loop:
        steps = [loop.tick(StepRequest(goal)) for goal in goals]
    ran = [step for step in steps if step.stage is Stage.RUN]
    assert len(ran) < NOTICED * twin.control_rate
    assert steps[-1].stage is Stage.FAULT


class AlteringRobot(SimulatedRobot):
    """Sends other actions than it is given, and says so."""

    gain = 1.0

    def send(self, action):
        rest = ArmGeometry.of(self.arm).action_neutral
        return super().send(rest + self.gain * (action - rest))


def test_a_robot_that_alters_commands_on_the_way_to_rest_still_goes_there(twin, clock):
    """Real: a simulation without errors is closed where it is."""
    robot = Puppet(twin, clock)
    patience = Patience(unsound=3, alone=10)
    loop = Loop(robot, Actor(twin), clock, patience=patience)
    loop.open()
    for _ in range(12):
        loop.tick(StepRequest())
    bent = robot.sent[-1]

    robot.send = lambda action: Puppet.send(robot, -action)
    loop.close()
    assert np.abs(robot.sent[-1]).max() < 0.05 * np.abs(bent).max()


def run_to_the_end(loop, goals):
    """Follow the goals, and close."""
    with loop:
        for goal in goals:
            loop.tick(StepRequest(goal))


@pytest.mark.parametrize("gain", slow_after(1, [1000.0, 1.6, -1.0]))
def test_a_robot_that_alters_commands_is_stopped_and_goes_to_rest(twin, gain):
    robot = AlteringRobot(twin)
    robot.gain = gain
    goals = circle(twin).goals[: round(SECONDS * twin.control_rate)]
    loop = Loop(robot, pcc_strategy(twin, PAPER))
    with pytest.raises(RobotError, match="a robot may limit a command, not enlarge"):
        run_to_the_end(loop, goals)
    np.testing.assert_allclose(
        robot.read()["cables"], ArmGeometry.of(twin).action_neutral, atol=1e-3
    )
